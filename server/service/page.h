// The page: the files of clients/page, which the build puts into the program.
#pragma once
#include "server/http/guarded_server.h"

namespace gonio {

// Whether the request is for the page's own files, which hold nothing secret and so need no token: a person
// cannot give one before the page that asks for it is there. "/" counts where the client prefers HTML.
bool is_page_request(const http::Request& request);

// GET /page/ and the files below it, with a strict content security policy.
void add_page(http::GuardedServer& server);

// 303 to the page, which is what a browser gets at "/".
http::Response to_page();

}  // namespace gonio
