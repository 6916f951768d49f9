// What the files of this folder share: one writer a format, and readers that take bytes, so that a fuzzer can
// reach them.
#pragma once
#include <charconv>
#include <ostream>
#include <string>
#include <string_view>

#include "table/table.h"

namespace gonio {

inline constexpr int table_format_version = 1;

// What every file says about its numbers. Tested by readers of other programs more than by ours: words, not
// codes.
inline constexpr std::string_view table_conventions[] = {
    "f: BRDF f_r in 1/sr, no cosine inside; wi points to the light, wo to the viewer, both away from the "
    "surface",
    "angles: degrees; theta from the normal +z, phi from +x (along columns) towards +y (along rows)",
    "se: standard error (one sigma) of f in 1/sr; bias: estimate of what the standard error cannot see, in "
    "1/sr",
};
// Said beside them if the table has cells.
inline constexpr std::string_view cell_convention =
    "cells: outgoing directions are the centres of receivers with bounds in theta and phi; f is the mean "
    "over the cell, "
    "weighted by the cosine: flux into the cell / (irradiance of the mean plane * projected solid angle of "
    "the cell)";

void write_csv(const Table& table, std::ostream& out);
void write_json(const Table& table, std::ostream& out);
void write_exr(const Table& table, const std::string& path);

// `name` (of the file) goes into the errors. Every length is checked before it is believed.
Table parse_csv(std::string_view text, const std::string& name);
Table parse_json(std::string_view text, const std::string& name);
Table parse_table(std::string_view text, const std::string& name);  // detects which of the two

// Throws Error naming the member: lengths that disagree, indices out of range, values that are not finite.
void validate(const Table& table);

// Shortest text that reads back bit-equal.
template <class Number>
void append_number(std::string& text, Number value) {
    char buffer[32];
    text.append(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
}

// Most programs (our JSON reader too) read a double and round it to float. An exhaustive search over all
// finite floats found one whose shortest text does not survive that, 7.038531e-26: it is written with a digit
// more.
inline void append_number(std::string& text, float value) {
    constexpr float fragile = 7.038531e-26f;
    if (value == fragile || value == -fragile)
        text += value > 0 ? "7.0385307e-26" : "-7.0385307e-26";
    else
        append_number<float>(text, value);
}

// Buffers what is appended to text() and hands it to the stream in large pieces.
class BlockWriter {
  public:
    explicit BlockWriter(std::ostream& out) : out_(out) { text_.reserve(block + 4096); }
    std::string& text() {
        if (text_.size() >= block) flush();
        return text_;
    }
    void flush() {
        out_.write(text_.data(), static_cast<std::streamsize>(text_.size()));
        text_.clear();
    }

  private:
    static constexpr size_t block = 1 << 18;
    std::ostream& out_;
    std::string text_;
};

}  // namespace gonio
