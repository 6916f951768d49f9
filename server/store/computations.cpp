// The life of a job: accepted, computed once for all of its hash, ended.
#include <algorithm>
#include <random>

#include "base/error.h"
#include "server/store/job_rows.h"
#include "server/store/store.h"

namespace gonio {
namespace {

std::string random_id() {
    std::random_device device;  // the kernel's random numbers: nobody guesses another's job
    std::string id;
    for (int word = 0; word < 4; ++word)
        for (unsigned bits = device(), digit = 0; digit < 8; ++digit, bits >>= 4)
            id += "0123456789abcdef"[bits & 15];
    return id;
}

bool is_file_name(const std::string& name) {
    return !name.empty() && name.size() <= 128 && name[0] != '.' &&
           std::all_of(name.begin(), name.end(),
                       [](unsigned char c) {
                           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') ||
                                  (c >= 'A' && c <= 'Z') || c == '.' || c == '_' || c == '-';
                       }) &&
           name != "document.json" && name != "SHA256SUMS";  // what an export adds
}

void dismiss_stopped(Database& database, const std::string& job_hash, int64_t at) {
    Statement(database,
              "UPDATE jobs SET status='dismissed', finished=?, updated=?, version=version+1 "
              "WHERE job_hash=? AND status='running' AND stop_requested",
              at, at, job_hash)
        .run();
}

// Ends every unfinished job of the hash. One that was told to stop is dismissed, however its computation
// ended.
void end_jobs(Database& database, const std::string& job_hash, JobStatus status, const std::string& message,
              const std::optional<std::string>& problem, int64_t at) {
    dismiss_stopped(database, job_hash, at);
    Statement(database,
              "UPDATE jobs SET status=?, message=?, problem=?, progress=iif(?, 100, progress), "
              "started=coalesce(started, ?), finished=?, updated=?, version=version+1 "
              "WHERE job_hash=? AND status IN ('accepted', 'running')",
              std::string(status_name(status)), message, problem, int{status == JobStatus::successful}, at,
              at, at, job_hash)
        .run();
}

std::string problem_of_deaths(int attempts) {
    return "{\"type\":\"about:blank\",\"title\":\"The computation ended the service\",\"status\":500,"
           "\"detail\":\"" +
           std::to_string(attempts) +
           " attempts to compute this job ended with the death of the process; it is not tried again\"}";
}

void put_back(Database& database, const std::string& job_hash, int attempts_spared, int64_t at) {
    dismiss_stopped(database, job_hash, at);
    Statement(database,
              "UPDATE jobs SET status='accepted', started=NULL, attempts=attempts-?, updated=?, "
              "version=version+1 WHERE job_hash=? AND status='running'",
              attempts_spared, at, job_hash)
        .run();
}

// The oldest equal job goes on with the computation of a dismissed one; false if there is none.
bool hand_over(Database& database, const StoredJob& from, int64_t at) {
    Statement(database,
              "UPDATE jobs SET status='running', started=?, attempts=?, progress=?, message=?, updated=?, "
              "version=version+1 WHERE sequence=(SELECT min(sequence) FROM jobs WHERE job_hash=? AND "
              "status='accepted')",
              at, from.attempts, from.progress, from.message, at, from.job_hash)
        .run();
    return database.changed_rows() > 0;
}

}  // namespace

Acceptance Store::accept(const NewJob& job) {
    const std::string id = random_id();
    const int64_t at = now();
    return writer_.run([&](Database& database) -> Acceptance {
        if (job.idempotency_key) {
            Statement earlier(database,
                              "SELECT id, request_hash FROM jobs WHERE owner=? AND idempotency_key=?",
                              job.owner, *job.idempotency_key);
            if (earlier.step())
                return {earlier.text(1) == job.request_hash ? Acceptance::Outcome::repeated
                                                            : Acceptance::Outcome::key_conflict,
                        *find_job(database, earlier.text(0))};
        }
        Statement(database, "UPDATE results SET last_used=? WHERE job_hash=?", at, job.job_hash).run();
        const bool known = database.changed_rows() > 0;
        Statement(
            database,
            "INSERT INTO jobs(id, process, document, job_hash, runs_hash, status, message, created, updated, "
            "owner, idempotency_key, request_hash) VALUES(?,?,?,?,?,'accepted',?,?,?,?,?,?)",
            id, job.process, job.document, job.job_hash, job.runs_hash, job.message, at, at, job.owner,
            job.idempotency_key, job.request_hash)
            .run();
        if (known) end_jobs(database, job.job_hash, JobStatus::successful, job.message, {}, at);
        const StoredJob stored = *find_job(database, id);
        for (const std::string& sha256 : job.surfaces) {
            Statement(database, "UPDATE surfaces SET last_used=? WHERE sha256=?", at, sha256).run();
            if (database.changed_rows() == 0)
                throw Error(ErrorCode::not_found, "surface", sha256, "is not in the store");
            Statement(database, "INSERT OR IGNORE INTO job_surfaces VALUES(?,?)", stored.sequence, sha256)
                .run();
        }
        return {Acceptance::Outcome::created, stored};
    });
}

std::optional<ClaimedJob> Store::next_job() {
    const int64_t at = now();
    return writer_.run([&](Database& database) -> std::optional<ClaimedJob> {
        Statement oldest(database,
                         "SELECT id, document FROM jobs AS mine WHERE status='accepted' AND NOT EXISTS("
                         "SELECT 1 FROM jobs WHERE job_hash=mine.job_hash AND status='running') "
                         "ORDER BY (SELECT max(attempts) FROM jobs WHERE job_hash=mine.job_hash AND "
                         "status='accepted') > 3, "
                         "sequence LIMIT 1");
        if (!oldest.step()) return {};
        const std::string id = oldest.text(0);
        Statement(database,
                  "UPDATE jobs SET status='running', message='', started=?, updated=?, attempts=attempts+1, "
                  "version=version+1 WHERE id=?",
                  at, at, id)
            .run();
        Statement(
            database,
            "UPDATE checkpoints SET last_used=? WHERE runs_hash=(SELECT runs_hash FROM jobs WHERE id=?)", at,
            id)
            .run();
        return ClaimedJob{*find_job(database, id), oldest.text(1)};
    });
}

void Store::succeed(const std::string& job_hash, const std::vector<NewOutput>& outputs) {
    if (outputs.empty()) throw Error(ErrorCode::internal, "outputs", "", "a result has at least one");
    for (const NewOutput& output : outputs)
        if (!is_file_name(output.name))
            throw Error(ErrorCode::internal, "output", output.name, "is no name for a file");
    const int64_t at = now();
    writer_.run([&](Database& database) {
        Statement(database, "DELETE FROM results WHERE job_hash=?", job_hash).run();
        for (const NewOutput& output : outputs)
            Statement(database, "INSERT INTO results VALUES(?,?,?,?,?,?,?)", job_hash, output.name,
                      output.media_type, output.object.sha256, output.object.bytes, at, at)
                .run();
        // Earlier jobs of this hash have their results again.
        Statement(database,
                  "UPDATE jobs SET expires=NULL, updated=?, version=version+1 "
                  "WHERE job_hash=? AND expires IS NOT NULL",
                  at, job_hash)
            .run();
        end_jobs(database, job_hash, JobStatus::successful, "", {}, at);
        return true;
    });
}

void Store::fail(const std::string& job_hash, const std::string& message, const std::string& problem) {
    const int64_t at = now();
    writer_.run([&](Database& database) {
        end_jobs(database, job_hash, JobStatus::failed, message, problem, at);
        return true;
    });
}

void Store::stopped(const std::string& job_hash) {
    const int64_t at = now();
    writer_.run([&](Database& database) {
        dismiss_stopped(database, job_hash, at);
        return true;
    });
}

void Store::release(const std::string& job_hash) {
    const int64_t at = now();
    writer_.run([&](Database& database) {
        put_back(database, job_hash, 1, at);
        return true;
    });
}

bool Store::try_again(const std::string& job_hash) {
    const int64_t at = now();
    return writer_.run([&](Database& database) {
        Statement last(database, "SELECT 1 FROM jobs WHERE job_hash=? AND status='running' AND attempts>=?",
                       job_hash, max_attempts_);
        if (last.step()) return false;
        put_back(database, job_hash, 0, at);
        return true;
    });
}

Dismissal Store::dismiss(const std::string& id) {
    const int64_t at = now();
    return writer_.run([&](Database& database) {
        const std::optional<StoredJob> job = find_job(database, id);
        if (!job) return Dismissal::not_found;
        if (job->status != JobStatus::accepted && job->status != JobStatus::running)
            return Dismissal::finished;
        const bool running = job->status == JobStatus::running;
        if (running && (job->stop_requested || !hand_over(database, *job, at))) {
            Statement(database,
                      "UPDATE jobs SET stop_requested=1, updated=?, version=version+1 "
                      "WHERE id=? AND NOT stop_requested",
                      at, id)
                .run();
            return Dismissal::stopping;
        }
        Statement(database,
                  "UPDATE jobs SET status='dismissed', finished=?, updated=?, version=version+1 WHERE id=?",
                  at, at, id)
            .run();
        return Dismissal::dismissed;
    });
}

void Store::save_checkpoint(const std::string& job_hash, const std::string& runs_hash, const std::string& key,
                            const StoredObject& object) {
    const int64_t at = now();
    writer_.run([&](Database& database) {
        Statement(database, "INSERT OR REPLACE INTO checkpoints VALUES(?,?,?,?,?)", runs_hash, key,
                  object.sha256, object.bytes, at)
            .run();
        // Who gets on is not what ends the process: only attempts without a new checkpoint count.
        Statement(database, "UPDATE jobs SET attempts=1 WHERE job_hash=? AND status='running' AND attempts>1",
                  job_hash)
            .run();
        return true;
    });
}

void Store::put_surface(const StoredObject& object) {
    const int64_t at = now();
    writer_.run([&](Database& database) {
        Statement(database,
                  "INSERT INTO surfaces VALUES(?,?,?,?) ON CONFLICT(sha256) DO UPDATE SET "
                  "last_used=excluded.last_used",
                  object.sha256, object.bytes, at, at)
            .run();
        return true;
    });
}

void Store::recover() {
    const int64_t at = now();
    writer_.run([&](Database& database) {
        std::vector<StoredJob> interrupted;
        {
            Statement rows(database, select_jobs("WHERE status='running'"));
            while (rows.step()) interrupted.push_back(read_job(rows));
        }
        for (const StoredJob& job : interrupted) {
            if (job.stop_requested) {
                dismiss_stopped(database, job.job_hash, at);
            } else if (job.attempts >= max_attempts_) {
                // With its equals: they would end the process as it did.
                end_jobs(database, job.job_hash, JobStatus::failed, "its computation ended the service",
                         problem_of_deaths(job.attempts), at);
            } else {
                Statement(database,
                          "UPDATE jobs SET status='accepted', started=NULL, updated=?, version=version+1 "
                          "WHERE id=?",
                          at, job.id)
                    .run();
            }
        }
        return true;
    });
}

}  // namespace gonio
