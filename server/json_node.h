// Strict JSON for documents that people write: every refusal names the JSON pointer of the value, what was
// found there and what is allowed. The only header that shows nlohmann::json; it stays inside server/.
#pragma once
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace gonio {

struct JsonLimits {
    size_t max_bytes = 256u << 20;
    int max_depth = 16;  // nlohmann parses 100,000 nested arrays and then overflows the stack in dump()
};

// Refuses (invalid_input, with line and column where there is one) what RFC 8259 leaves open and what bites
// later: a key written twice (nlohmann would keep the last), nesting deeper than max_depth, numbers that
// overflow to infinity, NaN, invalid UTF-8, text behind the value. Throws Error(limit) for a text above
// max_bytes.
nlohmann::json parse_json_strictly(std::string_view text, const JsonLimits& limits = {});

// A value and where it stands. Refers to the json it was made from; cheap to copy but for its path.
class JsonNode {
  public:
    explicit JsonNode(const nlohmann::json& value, std::string path = "")
        : json_(&value), path_(std::move(path)) {}

    const nlohmann::json& raw() const { return *json_; }
    const std::string& path() const { return path_; }
    // Throws Error(invalid_input): path = what is there: `allowed`.
    [[noreturn]] void refuse(const std::string& allowed) const;

    // Members: the value must be an object with no other key than these (unknown ones are refused with the
    // nearest allowed).
    void allow_keys(const std::vector<std::string>& keys) const;
    bool has(const std::string& key) const { return json_->is_object() && json_->contains(key); }
    JsonNode at(const std::string& key) const;                   // must be there
    std::optional<JsonNode> find(const std::string& key) const;  // nothing if it is not there
    JsonNode element(size_t i) const;                            // of an array

    // Scalars. `low` and `high` are inclusive.
    double number(double low, double high) const;
    double number() const;  // any finite one
    uint64_t whole_number(uint64_t low, uint64_t high) const;
    bool boolean() const;
    std::string text() const;  // not empty
    std::string choice(const std::vector<std::string>& allowed) const;
    double length() const;           // "5 mm", in metres, any sign
    double positive_length() const;  // > 0

    // An array of at least `least` elements; its size.
    size_t array_size(size_t least = 1) const;
    // Arrays of finite numbers. Rows: every element an array of exactly `columns` numbers, flattened. No
    // allocation per element.
    std::vector<double> numbers(size_t least = 1) const;
    std::vector<double> number_rows(size_t columns) const;

  private:
    const nlohmann::json* json_;
    std::string path_;
};

}  // namespace gonio
