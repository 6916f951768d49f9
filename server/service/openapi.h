// The OpenAPI 3.0 document of the service: openapi.json, as it is.
#pragma once
#include <string>

namespace gonio {

inline constexpr const char* openapi_media_type = "application/vnd.oai.openapi+json;version=3.0";
std::string openapi_document();

}  // namespace gonio
