// Rows of the table `jobs` as StoredJob.
#pragma once
#include <string>

#include "server/store/records.h"
#include "server/store/sqlite.h"

namespace gonio {

// "SELECT (all columns of StoredJob) FROM jobs " + rest; rest may go on from there ("WHERE id=?").
std::string select_jobs(const std::string& rest);
// The row on which a statement of select_jobs stands.
StoredJob read_job(const Statement& row);

std::optional<StoredJob> find_job(Database& database, const std::string& id);

}  // namespace gonio
