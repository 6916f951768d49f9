#include "server/http/json_limits.h"

#include "server/http/files.h"
#include "server/http/problem.h"

namespace gonio::http {

nlohmann::json read_json(Request& request, uint64_t most) {
    const std::string header = request.header("Content-Type");
    const std::string_view type = trimmed(std::string_view(header).substr(0, header.find(';')));
    constexpr std::string_view suffix = "+json", family = "application/";
    const bool is_json = equal_ignoring_case(type, "application/json") ||
                         (type.size() > family.size() + suffix.size() &&
                          equal_ignoring_case(type.substr(0, family.size()), family) &&
                          equal_ignoring_case(type.substr(type.size() - suffix.size()), suffix));
    if (!is_json) fail(415, "the body must be application/json");
    std::string text;
    copy_body(request, most, [&text](std::string_view piece) { text += piece; });
    return parse_json_strictly(text, {static_cast<size_t>(most), most_json_depth});
}

}  // namespace gonio::http
