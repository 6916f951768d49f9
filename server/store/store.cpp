// Opening, looking things up, telling of changes. What changes jobs is in computations.cpp, upkeep in
// upkeep.cpp.
#include "server/store/store.h"

#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "server/store/job_rows.h"

namespace gonio {
namespace {

int64_t system_now() {
    return std::chrono::duration_cast<std::chrono::milliseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
}

constexpr uintmax_t least_free_bytes = 256 << 20;

std::string prepared(const std::string& folder) {
    if (folder.empty()) throw Error(ErrorCode::io, "folder", "", "is empty");
    const std::string absolute = std::filesystem::absolute(folder).lexically_normal().string();
    if (make_folder(absolute)) sync_folder_or_die(std::filesystem::path(absolute).parent_path().string());
    return absolute;
}

}  // namespace

Store::Store(const StoreOptions& options)
    : now_(options.now ? options.now : system_now),
      max_attempts_(options.max_attempts),
      folder_(prepared(options.folder)),
      lock_(folder_),
      objects_(folder_),
      readers_(folder_ + "/jobs.db"),
      writer_(folder_ + "/jobs.db", {[this](Database& database) { write_pending(database); },
                                     [this] {
                                         const std::lock_guard lock(changes_mutex_);
                                         ++changes_;
                                         changed_.notify_all();
                                     }}) {
    sync_folder_or_die(folder_);  // the database's own name
    recover();
}

Store::~Store() = default;

std::string Store::no_room() const {
    std::error_code failure;
    const auto space = std::filesystem::space(folder_, failure);
    if (failure) return "the data folder cannot be read";
    if (space.available < least_free_bytes)
        return "less than 256 MiB are free on the disk of the data folder";
    return "";
}

std::optional<StoredJob> Store::find(const std::string& id) {
    return readers_.read([&](Database& database) { return find_job(database, id); });
}

std::optional<std::string> Store::document(const std::string& id) {
    return readers_.read([&](Database& database) {
        Statement row(database, "SELECT document FROM jobs WHERE id=?", id);
        return row.step() ? std::optional(row.text(0)) : std::nullopt;
    });
}

std::vector<StoredJob> Store::list(const JobFilter& filter) {
    // One statement for every filter: a condition whose parameter is NULL holds.
    std::string wanted = filter.statuses.empty() ? "" : "AND status IN (";
    for (const JobStatus status : filter.statuses) wanted += "'" + std::string(status_name(status)) + "',";
    if (!wanted.empty()) wanted.back() = ')';
    const std::string sql = select_jobs(
        "WHERE (?1 IS NULL OR sequence < ?1) AND (?2 IS NULL OR process = ?2) AND (?3 IS NULL OR owner = ?3) "
        "AND (?4 IS NULL OR created >= ?4) AND (?5 IS NULL OR created <= ?5) "
        "AND (?6 IS NULL OR coalesce(finished, ?8) - started >= ?6) "
        "AND (?7 IS NULL OR coalesce(finished, ?8) - started <= ?7) " +
        wanted + " ORDER BY sequence DESC LIMIT ?9");
    return readers_.read([&](Database& database) {
        Statement rows(database, sql, filter.after, filter.process, filter.owner, filter.created_from,
                       filter.created_to, filter.min_duration_ms, filter.max_duration_ms, now(),
                       filter.limit);
        std::vector<StoredJob> jobs;
        while (rows.step()) jobs.push_back(read_job(rows));
        return jobs;
    });
}

StoreCounts Store::counts() {
    return readers_.read([](Database& database) {
        StoreCounts counts;
        Statement rows(database,
                       "SELECT owner, sum(status = 'accepted'), sum(status = 'running') FROM jobs "
                       "WHERE status IN ('accepted', 'running') GROUP BY owner");
        while (rows.step()) {
            const QueueLength length{rows.integer(1), rows.integer(2)};
            counts.by_owner[rows.text(0)] = length;
            counts.all.queued += length.queued;
            counts.all.running += length.running;
        }
        return counts;
    });
}

std::vector<ResultOutput> Store::results(const std::string& job_hash) {
    return readers_.read([&](Database& database) {
        Statement rows(
            database,
            "SELECT name, media_type, sha256, bytes, created, last_used FROM results WHERE job_hash=? "
            "ORDER BY name",
            job_hash);
        std::vector<ResultOutput> outputs;
        while (rows.step())
            outputs.push_back({rows.text(0), rows.text(1), rows.text(2), rows.integer(3), rows.integer(4),
                               rows.integer(5)});
        return outputs;
    });
}

std::optional<Checkpoint> Store::load_checkpoint(const std::string& runs_hash, const std::string& key) {
    return readers_.read([&](Database& database) -> std::optional<Checkpoint> {
        Statement row(database, "SELECT sha256, bytes FROM checkpoints WHERE runs_hash=? AND key=?",
                      runs_hash, key);
        if (!row.step()) return {};
        return Checkpoint{key, row.text(0), row.integer(1)};
    });
}

std::vector<Checkpoint> Store::checkpoints(const std::string& runs_hash) {
    return readers_.read([&](Database& database) {
        Statement rows(database, "SELECT key, sha256, bytes FROM checkpoints WHERE runs_hash=? ORDER BY key",
                       runs_hash);
        std::vector<Checkpoint> found;
        while (rows.step()) found.push_back({rows.text(0), rows.text(1), rows.integer(2)});
        return found;
    });
}

bool Store::has_surface(const std::string& sha256) {
    return readers_.read([&](Database& database) {
        Statement row(database, "SELECT 1 FROM surfaces WHERE sha256=?", sha256);
        return row.step();
    });
}

bool Store::stop_requested(const std::string& job_hash) {
    return readers_.read([&](Database& database) {
        Statement row(database,
                      "SELECT 1 FROM jobs WHERE job_hash=? AND status='running' AND stop_requested LIMIT 1",
                      job_hash);
        return row.step();
    });
}

uint64_t Store::changes() const {
    const std::lock_guard lock(changes_mutex_);
    return changes_;
}

uint64_t Store::wait_for_change(uint64_t seen, std::chrono::milliseconds timeout) const {
    std::unique_lock lock(changes_mutex_);
    changed_.wait_for(lock, timeout, [&] { return changes_ != seen; });
    return changes_;
}

// A commit for every per cent of every job would keep the disk busy with what nobody needs after a crash: the
// last word of each job is written with the next group.
void Store::progress(const std::string& job_hash, int percent, const std::string& message,
                     int64_t relative_error_ppb) {
    {
        const std::lock_guard lock(pending_mutex_);
        pending_.progress[job_hash] = {
            std::clamp(percent, 0, 100), message,
            relative_error_ppb > 0 ? std::optional(relative_error_ppb) : std::nullopt};
    }
    writer_.nudge();
}

void Store::touch_surface(const std::string& sha256) {
    {
        const std::lock_guard lock(pending_mutex_);
        pending_.surfaces.insert(sha256);
    }
    writer_.nudge();
}

void Store::touch_results(const std::string& job_hash) {
    {
        const std::lock_guard lock(pending_mutex_);
        pending_.results.insert(job_hash);
    }
    writer_.nudge();
}

void Store::write_pending(Database& database) {
    Pending pending;
    {
        const std::lock_guard lock(pending_mutex_);
        std::swap(pending, pending_);
    }
    const int64_t at = now();
    for (const auto& [job_hash, state] : pending.progress)
        Statement(
            database,
            "UPDATE jobs SET progress=?, message=?, relative_error_ppb=coalesce(?, relative_error_ppb), "
            "updated=?, version=version+1 WHERE job_hash=? AND status='running'",
            state.percent, state.message, state.relative_error_ppb, at, job_hash)
            .run();
    for (const std::string& sha256 : pending.surfaces)
        Statement(database, "UPDATE surfaces SET last_used=? WHERE sha256=?", at, sha256).run();
    for (const std::string& job_hash : pending.results)
        Statement(database, "UPDATE results SET last_used=? WHERE job_hash=?", at, job_hash).run();
}

}  // namespace gonio
