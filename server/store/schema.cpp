#include "server/store/schema.h"

#include <iterator>

#include "base/error.h"

namespace gonio {
namespace {

// Step k brings a file from version k to k + 1. A step that has been released is never edited: a change is a
// new step. Times are ms since the epoch, UTC.
const char* const steps[] = {
    R"sql(
CREATE TABLE surfaces(
    sha256 TEXT PRIMARY KEY,
    bytes INTEGER NOT NULL,
    created INTEGER NOT NULL,
    last_used INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE jobs(
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    process TEXT NOT NULL,
    document TEXT NOT NULL,
    job_hash TEXT NOT NULL,
    status TEXT NOT NULL CHECK(status IN ('accepted', 'running', 'successful', 'failed', 'dismissed')),
    message TEXT NOT NULL DEFAULT '',
    progress INTEGER NOT NULL DEFAULT 0 CHECK(progress BETWEEN 0 AND 100),
    created INTEGER NOT NULL,
    started INTEGER,
    finished INTEGER,
    updated INTEGER NOT NULL,
    expires INTEGER,
    version INTEGER NOT NULL DEFAULT 1,
    attempts INTEGER NOT NULL DEFAULT 0,
    stop_requested INTEGER NOT NULL DEFAULT 0,
    owner TEXT NOT NULL,
    idempotency_key TEXT,
    request_hash TEXT NOT NULL,
    problem TEXT
) STRICT;
CREATE UNIQUE INDEX jobs_key ON jobs(owner, idempotency_key) WHERE idempotency_key IS NOT NULL;
CREATE INDEX jobs_unfinished ON jobs(status, sequence) WHERE status IN ('accepted', 'running');
CREATE INDEX jobs_hash ON jobs(job_hash, status);

CREATE TABLE job_surfaces(
    job INTEGER NOT NULL REFERENCES jobs(sequence) ON DELETE CASCADE,
    sha256 TEXT NOT NULL REFERENCES surfaces(sha256) ON DELETE CASCADE,
    PRIMARY KEY(job, sha256)
) STRICT, WITHOUT ROWID;
CREATE INDEX job_surfaces_sha256 ON job_surfaces(sha256);

CREATE TABLE results(
    job_hash TEXT NOT NULL,
    name TEXT NOT NULL,
    media_type TEXT NOT NULL,
    sha256 TEXT NOT NULL,
    bytes INTEGER NOT NULL,
    created INTEGER NOT NULL,
    last_used INTEGER NOT NULL,
    PRIMARY KEY(job_hash, name)
) STRICT, WITHOUT ROWID;
CREATE INDEX results_sha256 ON results(sha256);

CREATE TABLE checkpoints(
    job_hash TEXT NOT NULL,
    key TEXT NOT NULL,
    sha256 TEXT NOT NULL,
    bytes INTEGER NOT NULL,
    PRIMARY KEY(job_hash, key)
) STRICT, WITHOUT ROWID;
CREATE INDEX checkpoints_sha256 ON checkpoints(sha256);
)sql",
    "ALTER TABLE jobs ADD COLUMN relative_error_ppb INTEGER",
    // Checkpoints outlive their job, for others that can use them. Those of before are computed again.
    R"sql(
DROP TABLE checkpoints;
CREATE TABLE checkpoints(
    runs_hash TEXT NOT NULL,
    key TEXT NOT NULL,
    sha256 TEXT NOT NULL,
    bytes INTEGER NOT NULL,
    last_used INTEGER NOT NULL,
    PRIMARY KEY(runs_hash, key)
) STRICT, WITHOUT ROWID;
CREATE INDEX checkpoints_sha256 ON checkpoints(sha256);
ALTER TABLE jobs ADD COLUMN runs_hash TEXT NOT NULL DEFAULT '';
)sql",
};

int64_t version_of(Database& database) {
    Statement version(database, "PRAGMA user_version");
    version.step();
    return version.integer(0);
}

}  // namespace

void migrate(Database& database) {
    constexpr auto known = static_cast<int64_t>(std::size(steps));
    int64_t version = version_of(database);
    if (version > known)
        throw Error(ErrorCode::io, database.path(), "",
                    "was written by a newer gonio (version " + std::to_string(version) +
                        " of the tables; this one knows " + std::to_string(known) + ")");
    for (; version < known; ++version) {
        database.execute("BEGIN IMMEDIATE");
        try {
            database.execute(steps[version]);
            database.execute(("PRAGMA user_version=" + std::to_string(version + 1)).c_str());
            database.execute("COMMIT");
        } catch (const Error&) {
            if (database.in_transaction()) database.execute("ROLLBACK");
            throw;
        }
    }
}

}  // namespace gonio
