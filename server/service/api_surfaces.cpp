// Uploads: height fields and albedo maps, named by the SHA-256 of their bytes. Who knows the name may read
// it: it cannot be guessed, and says nothing but that somebody has that very file.
#include "server/http/files.h"
#include "server/service/api.h"
#include "server/service/responses.h"

namespace gonio {

using http::Request;
using http::Response;

void Api::add_surfaces() {
    server_.route("PUT", "/surfaces/{}", [this](Request& request) {
        refuse_while_draining();
        const std::string& sha256 = request.captures[0];
        if (!is_sha256(sha256)) http::fail(400, "a surface is named by the SHA-256 of its bytes, in hex");
        const bool known = store_.has_surface(sha256);
        ObjectWriter writer = store_.objects().writer();
        http::copy_body(request, limits_.surface_bytes, [&](std::string_view bytes) { writer.write(bytes); });
        store_.put_surface(writer.finish(sha256));
        Response response = json_response(known ? 200 : 201, {{"sha256", sha256}});
        response.set("Location", "/surfaces/" + sha256);
        return response;
    });
    server_.route("GET", "/surfaces/{}", [this](Request& request) {
        const std::string& sha256 = request.captures[0];
        if (!store_.has_surface(sha256)) http::fail(404, "there is no surface " + sha256);
        store_.touch_surface(sha256);
        http::FileOffer offer;
        offer.sha256 = sha256;
        offer.immutable = true;
        return http::serve_file(request, store_.objects().path(sha256), offer);
    });
}

}  // namespace gonio
