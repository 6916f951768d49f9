#include "server/npy_file.h"

#include "base/atomic_file.h"

namespace gonio {

// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html, version 1.0
void write_npy_file(const std::string& path, const std::string& descr, const std::vector<size_t>& shape,
                    const std::function<nlohmann::ordered_json(std::ostream&)>& write) {
    std::string extents;
    for (const size_t extent : shape) extents += std::to_string(extent) + ", ";
    std::string header = "{'descr': " + descr + ", 'fortran_order': False, 'shape': (" + extents + "), }";
    constexpr size_t magic = 10, alignment = 64;
    while ((magic + header.size() + 1) % alignment != 0) header += ' ';
    header += '\n';
    const auto length = static_cast<uint16_t>(header.size());
    write_file_atomically(path, [&](std::ostream& out) {
        out << "\x93NUMPY" << '\x01' << '\x00' << static_cast<char>(length & 0xff)
            << static_cast<char>(length >> 8) << header;
        const nlohmann::ordered_json head = write(out);
        out << "\n" << head.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << "\n";
    });
}

}  // namespace gonio
