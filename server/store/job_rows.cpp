#include "server/store/job_rows.h"

#include <array>

#include "base/error.h"

namespace gonio {
namespace {

constexpr std::array<std::string_view, 5> names = {"accepted", "running", "successful", "failed",
                                                   "dismissed"};

}  // namespace

std::string_view status_name(JobStatus status) {
    return names[static_cast<size_t>(status)];
}

JobStatus status_named(std::string_view name) {
    for (size_t k = 0; k < names.size(); ++k)
        if (names[k] == name) return static_cast<JobStatus>(k);
    throw Error(ErrorCode::invalid_input, "status", std::string(name),
                "must be accepted, running, successful, failed or dismissed");
}

std::string select_jobs(const std::string& rest) {
    return "SELECT sequence, id, process, job_hash, owner, status, message, progress, created, started, "
           "finished, "
           "updated, expires, version, attempts, stop_requested, problem, relative_error_ppb FROM jobs " +
           rest;
}

StoredJob read_job(const Statement& row) {
    StoredJob job;
    job.sequence = row.integer(0);
    job.id = row.text(1);
    job.process = row.text(2);
    job.job_hash = row.text(3);
    job.owner = row.text(4);
    job.status = status_named(row.text(5));
    job.message = row.text(6);
    job.progress = static_cast<int>(row.integer(7));
    job.created = row.integer(8);
    job.started = row.optional_integer(9);
    job.finished = row.optional_integer(10);
    job.updated = row.integer(11);
    job.expires = row.optional_integer(12);
    job.version = row.integer(13);
    job.attempts = static_cast<int>(row.integer(14));
    job.stop_requested = row.integer(15) != 0;
    job.problem = row.optional_text(16);
    job.relative_error_ppb = row.optional_integer(17);
    return job;
}

std::optional<StoredJob> find_job(Database& database, const std::string& id) {
    Statement row(database, select_jobs("WHERE id=?"), id);
    return row.step() ? std::optional(read_job(row)) : std::nullopt;
}

}  // namespace gonio
