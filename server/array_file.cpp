#include "server/array_file.h"

#include <algorithm>
#include <filesystem>

#include "base/atomic_file.h"
#include "base/error.h"
#include "server/json_node.h"

namespace gonio {
namespace {

using nlohmann::ordered_json;

constexpr size_t page = 4096, alignment = 64;
constexpr size_t max_head_bytes = 64 << 20;
constexpr size_t max_array_bytes = size_t{1} << 46;

size_t rounded_up(size_t n, size_t unit) {
    return (n + unit - 1) / unit * unit;
}

size_t number_bytes(const std::string& dtype) {
    return dtype == "<f2" ? 2 : 4;
}

ordered_json to_json(const std::vector<ArraySection>& sections) {
    ordered_json list = ordered_json::array();
    for (const ArraySection& s : sections)
        list.push_back({{"name", s.name}, {"dtype", s.dtype}, {"shape", s.shape}, {"offset", s.offset}});
    return list;
}

// Offsets behind a first line of that many bytes; where the last array ends.
size_t place(std::vector<ArraySection>& sections, size_t first) {
    size_t end = first;
    for (ArraySection& section : sections) {
        section.offset = rounded_up(end, alignment);
        end = section.offset + section.bytes();
    }
    return end;
}

}  // namespace

size_t ArraySection::bytes() const {
    size_t n = number_bytes(dtype);
    for (const size_t extent : shape) n *= extent;
    return n;
}

void ArrayWriter::append_bytes(const char* bytes, size_t n) {
    while (n > 0) {
        if (section_ == sections_.size())
            throw Error(ErrorCode::internal, "", "", "more numbers than arrays to hold them");
        const ArraySection& section = sections_[section_];
        if (written_ == 0) {
            static constexpr char zeros[alignment] = {};
            out_.write(zeros, static_cast<std::streamsize>(section.offset - position_));
            position_ = section.offset;
        }
        const size_t piece = std::min(n, section.bytes() - written_);
        out_.write(bytes, static_cast<std::streamsize>(piece));
        bytes += piece;
        n -= piece;
        position_ += piece;
        written_ += piece;
        if (written_ == section.bytes()) ++section_, written_ = 0;
    }
}

void ArrayWriter::finish() {
    if (section_ != sections_.size())
        throw Error(ErrorCode::internal, "", "", "arrays that were not written");
}

void write_array_file(const std::string& path, ordered_json head, std::vector<ArraySection> sections,
                      const std::function<void(ArrayWriter&)>& write) {
    // The line's length depends on the offsets, and they on it: with the largest offsets it is long enough.
    place(sections, max_head_bytes);
    head["arrays"] = to_json(sections);
    const auto dumped = [&] { return head.dump(-1, ' ', false, ordered_json::error_handler_t::replace); };
    const size_t first = rounded_up(dumped().size() + sections.size() * 20 + 1, page);
    place(sections, first);
    head["arrays"] = to_json(sections);
    std::string line = dumped();
    line.resize(first - 1, ' ');
    line += '\n';
    write_file_atomically(path, [&](std::ostream& out) {
        out.write(line.data(), static_cast<std::streamsize>(line.size()));
        ArrayWriter writer(out, sections, first);
        write(writer);
        writer.finish();
    });
}

ArrayFile::ArrayFile(const std::string& path) : path_(path) {
    std::error_code failure;
    if (!std::filesystem::exists(path, failure)) throw Error(ErrorCode::not_found, path, "", "no such file");
    if (!std::filesystem::is_regular_file(path, failure))
        throw Error(ErrorCode::io, path, "", "not a regular file");
    const auto refuse = [&](const std::string& why) {
        throw Error(ErrorCode::invalid_input, path, "", "not a file of arrays that gonio writes: " + why);
    };
    in_.open(path, std::ios::binary);
    std::string line;
    if (in_.peek() != '{') refuse("it does not begin with {");
    // Not getline: a file of strangers need not have a line end.
    for (size_t at; (at = line.find('\n')) == std::string::npos;) {
        if (line.size() > max_head_bytes) refuse("its first line does not end");
        const size_t before = line.size();
        line.resize(before + page);
        in_.read(line.data() + before, page);
        line.resize(before + static_cast<size_t>(std::max<std::streamsize>(in_.gcount(), 0)));
        if (line.size() == before) refuse("it is cut off");
    }
    line.resize(line.find('\n'));
    const nlohmann::json checked = parse_json_strictly(line, {max_head_bytes, 16});
    head_ = ordered_json::parse(line);
    const JsonNode root(checked, path), arrays = root.at("arrays");
    const size_t file_bytes = std::filesystem::file_size(path, failure);
    for (size_t i = 0; i < arrays.array_size(); ++i) {
        const JsonNode entry = arrays.element(i);
        ArraySection section{entry.at("name").text(),
                             entry.at("dtype").choice({"<f2", "<f4", "<u4"}),
                             {},
                             entry.at("offset").whole_number(0, max_array_bytes)};
        size_t n = 1;
        const JsonNode shape = entry.at("shape");
        for (size_t k = 0; k < shape.array_size(); ++k) {
            section.shape.push_back(shape.element(k).whole_number(1, max_array_bytes));
            if (section.shape.back() > max_array_bytes / n) refuse("an array is larger than any file");
            n *= section.shape.back();
        }
        if (section.offset < line.size() || section.offset + section.bytes() > file_bytes)
            refuse("array " + section.name + " ends beyond the file");
        sections_.push_back(std::move(section));
    }
    head_.erase("arrays");
}

const ArraySection& ArrayFile::find(const std::string& name, const std::string& dtype,
                                    const std::vector<size_t>& shape) const {
    for (const ArraySection& section : sections_)
        if (section.name == name && section.dtype == dtype && section.shape == shape) return section;
    throw Error(ErrorCode::invalid_input, path_, "",
                "has no array " + name + " of the type and shape that is needed");
}

void ArrayFile::load(const ArraySection& section, char* to) {
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(section.offset));
    in_.read(to, static_cast<std::streamsize>(section.bytes()));
    if (!in_) throw Error(ErrorCode::io, path_, "", "cannot be read");
}

}  // namespace gonio
