// Feeds bytes to the table readers. Whatever the bytes, only Error may come out; and what is read is a table
// that writes and reads back as itself.
#include <cstdint>
#include <sstream>
#include <string_view>

#include "base/error.h"
#include "table/io/formats.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace gonio;
    try {
        const Table table = parse_table({reinterpret_cast<const char*>(data), size}, "fuzz");
        validate(table);
        std::ostringstream text;
        write_json(table, text);
        const Table again = parse_table(text.str(), "fuzz");
        if (again.f != table.f || again.incident != table.incident || again.pairs != table.pairs)
            __builtin_trap();
    } catch (const Error&) {
    }
    return 0;
}
