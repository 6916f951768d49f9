// Tables as files. One file a format, one line a format in table_io.cpp. Files are written aside, synced and renamed: a reader never
// meets half a table, and an interrupted run leaves nothing behind.
#pragma once
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

}  // namespace gonio
