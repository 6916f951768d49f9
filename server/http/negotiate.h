// Which of several representations a client wants.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/http/problem.h"

namespace gonio::http {

struct Choice {
    std::string name;        // of ?f=NAME
    std::string media_type;  // without parameters
};

// Index of the representation; of equally wanted ones the first. `name`, where it is not empty, overrides the
// Accept header, for links and browsers. Nothing if none of them is acceptable.
std::optional<size_t> negotiate(std::string_view accept, std::string_view name,
                                std::span<const Choice> choices);

// 406, with the list of what there is.
Problem not_acceptable(std::span<const Choice> choices);

}  // namespace gonio::http
