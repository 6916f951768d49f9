// Tables as files. One file a format, one line a format in table_io.cpp. Files are written aside, synced and renamed: a reader never
// meets half a table, and an interrupted run leaves nothing behind.
#pragma once
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "table/table.h"

namespace gonio {

// Names of the formats that write_table takes: "csv", "json", "exr".
const std::vector<std::string>& table_formats();

// format: one of table_formats(). Throws Error(io) with the path, Error(invalid_input) for an unknown format.
void write_table(const Table& table, const std::string& format, const std::string& path);

// Reads what write_table wrote (csv or json; found by content). Throws Error for anything else.
Table read_table(const std::string& path);

// Writes `path` aside (same folder), fsyncs it, renames it, fsyncs the folder; removes the temporary if `write` throws.
void write_file_atomically(const std::string& path, const std::function<void(std::ostream&)>& write);
// The same for libraries that want a file name: `write` gets the temporary's path.
void write_path_atomically(const std::string& path, const std::function<void(const std::string& temporary)>& write);

}  // namespace gonio
