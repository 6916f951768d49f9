#include "table/io/table_io.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include "base/atomic_file.h"
#include "base/error.h"
#include "table/io/formats.h"

namespace gonio {
namespace {

struct Format {
    std::string name;
    void (*write)(const Table& table, const std::string& path);
};

// A new format is one file in this folder and one line here.
const std::vector<Format> formats = {
    {"csv",
     [](const Table& t, const std::string& path) {
         write_file_atomically(path, [&](std::ostream& out) { write_csv(t, out); });
     }},
    {"json",
     [](const Table& t, const std::string& path) {
         write_file_atomically(path, [&](std::ostream& out) { write_json(t, out); });
     }},
    {"exr",
     [](const Table& t, const std::string& path) {
         write_path_atomically(path, [&](const std::string& temporary) { write_exr(t, temporary); });
     }},
};

// Text of a table beyond this is no table that this program could hold beside its parsed form.
constexpr std::uintmax_t max_table_bytes = std::uintmax_t{4} << 30;

[[noreturn]] void refuse(const std::string& member, const std::string& value, const std::string& allowed) {
    throw Error(ErrorCode::invalid_input, "table." + member, value, allowed);
}

void check_angles(const std::vector<AnglesDeg>& directions, const std::string& member) {
    if (directions.empty()) refuse(member, "0 directions", "at least one is needed");
    for (const AnglesDeg& a : directions)
        if (!std::isfinite(a.theta_deg) || !std::isfinite(a.phi_deg))
            refuse(member, "not finite", "finite angles");
}

void check_cells(const Table& table) {
    if (table.cells.empty()) return;
    if (table.cells.size() != table.outgoing.size())
        refuse("cells", std::to_string(table.cells.size()) + " cells", "as many as outgoing directions");
    for (const ReceiverCell& c : table.cells)
        if (!(c.theta_min_deg >= 0 && c.theta_min_deg < c.theta_max_deg && c.theta_max_deg <= 90) ||
            !std::isfinite(c.phi_min_deg) || !std::isfinite(c.phi_max_deg) ||
            !(c.phi_min_deg < c.phi_max_deg))
            refuse("cells", "bounds", "0 <= theta_min < theta_max <= 90 and finite phi_min < phi_max");
}

void check_values(const Table& table, const std::vector<float>& values, const std::string& member) {
    const size_t expected = table.channels.size() * table.slices() * table.rows();
    if (values.size() != expected) {
        refuse(member, std::to_string(values.size()) + " values",
               std::to_string(expected) + " are needed (channels x orders x rows)");
    }
    for (size_t k = 0; k < values.size(); ++k)
        if (!std::isfinite(values[k]))
            refuse(member, "not finite at index " + std::to_string(k), "finite values");
}

}  // namespace

void validate(const Table& table) {
    check_angles(table.incident, "incident");
    check_angles(table.outgoing, "outgoing");
    check_cells(table);
    for (const auto& [i, o] : table.pairs) {
        if (i < 0 || o < 0 || static_cast<size_t>(i) >= table.incident.size() ||
            static_cast<size_t>(o) >= table.outgoing.size()) {
            refuse("pairs", "(" + std::to_string(i) + ", " + std::to_string(o) + ")",
                   "indices of existing directions");
        }
    }
    if (table.channels.empty()) refuse("channels", "none", "at least one is needed");
    for (const std::string& channel : table.channels) {
        if (channel.empty() || channel.find_first_of(",\"\r\n#") != std::string::npos)
            refuse("channels", "\"" + channel + "\"", "a name without commas, quotes, # and line ends");
    }
    if (table.orders < 0) refuse("orders", std::to_string(table.orders), "0 or more");
    check_values(table, table.f, "f");
    check_values(table, table.se, "se");
    check_values(table, table.bias, "bias");
}

const std::vector<std::string>& table_formats() {
    static const std::vector<std::string> names = [] {
        std::vector<std::string> list;
        for (const Format& format : formats) list.push_back(format.name);
        return list;
    }();
    return names;
}

void write_table(const Table& table, const std::string& format, const std::string& path) {
    for (const Format& candidate : formats) {
        if (candidate.name != format) continue;
        validate(table);
        candidate.write(table, path);
        return;
    }
    std::string allowed = "one of";
    for (const std::string& name : table_formats()) allowed += " " + name;
    throw Error(ErrorCode::invalid_input, "format", "\"" + format + "\"", allowed);
}

Table parse_table(std::string_view text, const std::string& name) {
    const size_t start = text.find_first_not_of(" \t\r\n");
    if (start != std::string_view::npos && text[start] == '{') return parse_json(text, name);
    if (start != std::string_view::npos &&
        (text[start] == '#' || text.substr(start).starts_with("theta_i_deg")))
        return parse_csv(text, name);
    throw Error(ErrorCode::invalid_input, name, "",
                "not a table: neither the CSV nor the JSON that gonio writes");
}

Table read_table(const std::string& path) {
    std::error_code failure;
    const auto status = std::filesystem::status(path, failure);
    if (!std::filesystem::exists(status)) throw Error(ErrorCode::not_found, path, "", "no such file");
    if (!std::filesystem::is_regular_file(status)) throw Error(ErrorCode::io, path, "", "not a regular file");
    const std::uintmax_t bytes = std::filesystem::file_size(path, failure);
    if (failure) throw Error(ErrorCode::io, path, "", failure.message());
    if (bytes > max_table_bytes) {
        throw Error(ErrorCode::limit, path, std::to_string(bytes) + " bytes",
                    "at most " + std::to_string(max_table_bytes) + " bytes");
    }
    std::string text(bytes, '\0');
    std::ifstream in(path, std::ios::binary);
    in.read(text.data(), static_cast<std::streamsize>(bytes));
    if (!in) throw Error(ErrorCode::io, path, "", "cannot be read");
    return parse_table(text, path);
}

}  // namespace gonio
