#include "server/json_node.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "server/lengths.h"

namespace gonio {
namespace {

using nlohmann::json;

// RFC 6901: "~" and "/" inside a key.
std::string pointer_token(const std::string& key) {
    std::string token;
    for (const char c : key) token += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
    return token;
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
    return text;
}

// Levenshtein distance: how many letters were mistyped.
size_t edit_distance(const std::string& a, const std::string& b) {
    std::vector<size_t> row(b.size() + 1);
    for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (size_t i = 0; i < a.size(); ++i) {
        size_t diagonal = std::exchange(row[0], i + 1);
        for (size_t j = 0; j < b.size(); ++j) {
            const size_t substituted = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = std::min({substituted, row[j] + 1, diagonal + 1});
        }
    }
    return row.back();
}

// " (did you mean ...?", or nothing when no allowed word is within a third of the letters (and a key is of a
// sane length).
std::string suggestion(const std::string& word, const std::vector<std::string>& allowed) {
    if (word.size() > 64) return "";
    const std::string* nearest = nullptr;
    size_t least = std::max<size_t>(2, word.size() / 3) + 1;
    for (const std::string& candidate : allowed) {
        if (const size_t distance = edit_distance(word, candidate); distance < least) {
            least = distance;
            nearest = &candidate;
        }
    }
    return nearest ? " (did you mean \"" + *nearest + "\"?)" : "";
}

// What a message shows of a value: scalars as written, the rest by kind (an array may hold millions of
// numbers).
std::string shown(const json& value) {
    if (value.is_array()) return "an array of " + std::to_string(value.size());
    if (value.is_object()) return "an object";
    std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
    constexpr size_t longest = 60;
    return text.size() > longest ? text.substr(0, longest) + "..." : text;
}

bool is_finite_number(const json& value) {
    return value.is_number() && std::isfinite(value.get<double>());
}

}  // namespace

json parse_json_strictly(std::string_view text, const JsonLimits& limits) {
    if (text.size() > limits.max_bytes) {
        throw Error(ErrorCode::limit, "", std::to_string(text.size()) + " bytes",
                    "a document may have at most " + std::to_string(limits.max_bytes) + " bytes");
    }
    struct Open {  // an object or array whose end has not come
        bool is_array;
        size_t elements = 0;   // so far
        std::string key = {};  // the newest
        std::set<std::string> keys = {};
    };
    std::vector<Open> open;
    const auto watch = [&](int depth, json::parse_event_t event, json& parsed) {
        using Event = json::parse_event_t;  // clang 14 has no "using enum" for an alias
        const bool starts = event == Event::object_start || event == Event::array_start;
        if ((starts || event == Event::value) && !open.empty()) ++open.back().elements;
        if (starts) {
            if (depth >= limits.max_depth) {
                throw Error(ErrorCode::invalid_input, "", "",
                            "the document is nested deeper than " + std::to_string(limits.max_depth));
            }
            open.push_back({event == Event::array_start});
        } else if (event == Event::object_end || event == Event::array_end) {
            open.pop_back();
        } else if (event == Event::key) {
            open.back().key = pointer_token(parsed.get<std::string>());
            if (!open.back().keys.insert(open.back().key).second) {
                std::string path;
                for (const Open& one : open) {
                    path += "/" + (one.is_array ? std::to_string(one.elements - 1) : one.key);
                }
                throw Error(ErrorCode::invalid_input, path, "", "this key is written twice");
            }
        }
        return true;
    };
    try {
        return json::parse(text.begin(), text.end(), watch);
    } catch (const json::exception& failure) {
        // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."
        const std::string message = failure.what();
        const size_t bracket = message.find("] ");
        throw Error(ErrorCode::invalid_input, "", "",
                    "not JSON: " + (bracket == std::string::npos ? message : message.substr(bracket + 2)));
    }
}

void JsonNode::refuse(const std::string& allowed) const {
    throw Error(ErrorCode::invalid_input, path_.empty() ? "/" : path_, shown(*json_), allowed);
}

void JsonNode::allow_keys(const std::vector<std::string>& keys) const {
    if (!json_->is_object()) refuse("must be an object with the keys " + joined(keys));
    for (const auto& [key, value] : json_->items()) {
        if (std::find(keys.begin(), keys.end(), key) != keys.end()) continue;
        throw Error(ErrorCode::invalid_input, path_ + "/" + pointer_token(key), "",
                    "unknown key" + suggestion(key, keys) + "; allowed here: " + joined(keys));
    }
}

JsonNode JsonNode::at(const std::string& key) const {
    if (!json_->is_object()) refuse("must be an object");
    const auto found = json_->find(key);
    if (found == json_->end()) {
        throw Error(ErrorCode::invalid_input, path_ + "/" + pointer_token(key), "", "is needed and missing");
    }
    return JsonNode(*found, path_ + "/" + pointer_token(key));
}

std::optional<JsonNode> JsonNode::find(const std::string& key) const {
    if (!has(key)) return std::nullopt;
    return at(key);
}

JsonNode JsonNode::element(size_t i) const {
    return JsonNode(json_->at(i), path_ + "/" + std::to_string(i));
}

double JsonNode::number() const {
    if (!is_finite_number(*json_)) refuse("must be a number");
    return json_->get<double>() + 0.0;  // -0 becomes 0, so that both hash alike
}

double JsonNode::number(double low, double high) const {
    const double x = json_->is_number() ? json_->get<double>() : std::nan("");
    if (!(x >= low && x <= high))
        refuse("must be a number from " + number_text(low) + " to " + number_text(high));
    return x + 0.0;
}

uint64_t JsonNode::whole_number(uint64_t low, uint64_t high) const {
    constexpr double exact =
        0x1p53;  // above it, a floating-point number may have been rounded: 1e19 is refused, 64.0 is 64
    std::optional<uint64_t> n;
    if (json_->is_number_unsigned()) n = json_->get<uint64_t>();
    if (json_->is_number_float()) {
        const double x = json_->get<double>();
        if (x >= 0 && x <= exact && x == std::floor(x)) n = static_cast<uint64_t>(x);
    }
    if (!n || *n < low || *n > high) {
        refuse("must be a whole number from " + std::to_string(low) + " to " + std::to_string(high));
    }
    return *n;
}

bool JsonNode::boolean() const {
    if (!json_->is_boolean()) refuse("must be true or false");
    return json_->get<bool>();
}

std::string JsonNode::text() const {
    if (!json_->is_string() || json_->get_ref<const std::string&>().empty())
        refuse("must be a text that is not empty");
    return json_->get<std::string>();
}

std::string JsonNode::choice(const std::vector<std::string>& allowed) const {
    const std::string word = json_->is_string() ? json_->get<std::string>() : "";
    if (std::find(allowed.begin(), allowed.end(), word) == allowed.end()) {
        const std::string hint = json_->is_string() ? suggestion(word, allowed) : "";
        refuse("must be one of " + joined(allowed) + hint);
    }
    return word;
}

double JsonNode::length() const {
    if (json_->is_number()) {
        throw Error(
            ErrorCode::missing_unit, path_, shown(*json_),
            "a length needs a unit: one of " + length_units_text() + ", as in \"" + shown(*json_) + " mm\"");
    }
    if (!json_->is_string()) refuse("must be a length with its unit, as in \"5 mm\"");
    return parse_length(json_->get_ref<const std::string&>(), path_);
}

double JsonNode::positive_length() const {
    const double metres = length();
    if (!(metres > 0)) refuse("must be a length above 0");
    return metres;
}

size_t JsonNode::array_size(size_t least) const {
    if (!json_->is_array() || json_->size() < least) {
        refuse("must be an array of " + std::to_string(least) + " or more");
    }
    return json_->size();
}

std::vector<double> JsonNode::numbers(size_t least) const {
    std::vector<double> values(array_size(least));
    for (size_t i = 0; i < values.size(); ++i) {
        const json& value = (*json_)[i];
        if (!is_finite_number(value)) element(i).refuse("must be a number");
        values[i] = value.get<double>() + 0.0;
    }
    return values;
}

std::vector<double> JsonNode::number_rows(size_t columns) const {
    std::vector<double> values(array_size() * columns);
    for (size_t i = 0; i < json_->size(); ++i) {
        const json& row = (*json_)[i];
        if (!row.is_array() || row.size() != columns) {
            element(i).refuse("must be an array of " + std::to_string(columns) + " numbers");
        }
        for (size_t k = 0; k < columns; ++k) {
            if (!is_finite_number(row[k])) element(i).element(k).refuse("must be a number");
            values[i * columns + k] = row[k].get<double>() + 0.0;
        }
    }
    return values;
}

}  // namespace gonio
