// Files of large arrays: one line of JSON that says what follows, then the numbers as they lie in memory.
//
// The first line is a JSON object and ends with spaces and a line end, so that `head -1 FILE` shows it and
// the numbers start at a multiple of 4096. Its last member "arrays" lists name, dtype (as NumPy spells it:
// "<f2", "<f4", "<u4"), shape and offset in bytes of each array; offsets are multiples of 64. A program needs
// ten lines to read it, and may map it instead of loading it.
#pragma once
#include <cstddef>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace gonio {

struct ArraySection {
    std::string name, dtype;
    std::vector<size_t> shape;
    size_t offset = 0;

    size_t bytes() const;
};

// Takes the arrays' bytes in order, in pieces of any size.
class ArrayWriter {
  public:
    ArrayWriter(std::ostream& out, std::vector<ArraySection> sections, size_t position)
        : out_(out), sections_(std::move(sections)), position_(position) {}
    template <class Number>
    void append(std::span<const Number> numbers) {
        append_bytes(reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes());
    }
    void finish();

  private:
    void append_bytes(const char* bytes, size_t n);
    std::ostream& out_;
    std::vector<ArraySection> sections_;
    size_t section_ = 0, written_ = 0, position_;
};

// Whole or not at all. `write` appends every array, in the order of `sections`.
void write_array_file(const std::string& path, nlohmann::ordered_json head,
                      std::vector<ArraySection> sections, const std::function<void(ArrayWriter&)>& write);

// Reads the first line; arrays are read when they are asked for. Throws Error(not_found), Error(io),
// Error(invalid_input) for what is no such file, is cut off, or has arrays that lie elsewhere than it says.
class ArrayFile {
  public:
    explicit ArrayFile(const std::string& path);
    const nlohmann::ordered_json& head() const { return head_; }  // without "arrays"
    const std::vector<ArraySection>& sections() const { return sections_; }
    // Throws Error(invalid_input) if there is none of that name, type and shape.
    template <class Number>
    std::vector<Number> read(const std::string& name, const std::string& dtype,
                             const std::vector<size_t>& shape) {
        const ArraySection& section = find(name, dtype, shape);
        std::vector<Number> numbers(section.bytes() / sizeof(Number));
        load(section, reinterpret_cast<char*>(numbers.data()));
        return numbers;
    }

  private:
    const ArraySection& find(const std::string& name, const std::string& dtype,
                             const std::vector<size_t>& shape) const;
    void load(const ArraySection& section, char* to);
    std::string path_;
    std::ifstream in_;
    nlohmann::ordered_json head_;
    std::vector<ArraySection> sections_;
};

}  // namespace gonio
