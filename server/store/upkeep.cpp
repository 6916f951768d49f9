// Retention, verification, export.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <unordered_map>

#include "base/atomic_file.h"
#include "base/error.h"
#include "server/store/job_rows.h"
#include "server/store/store.h"

namespace gonio {
namespace {

// Every object to which a row points, once.
const char* const referenced =
    "SELECT sha256, bytes FROM surfaces UNION SELECT sha256, bytes FROM results UNION "
    "SELECT sha256, bytes FROM checkpoints";

bool is_referenced(Database& database, const std::string& sha256) {
    Statement row(
        database,
        "SELECT 1 WHERE EXISTS(SELECT 1 FROM surfaces WHERE sha256=?1) OR EXISTS(SELECT 1 FROM results WHERE "
        "sha256=?1) OR EXISTS(SELECT 1 FROM checkpoints WHERE sha256=?1)",
        sha256);
    return row.step();
}

int64_t kept_bytes(Database& database) {
    Statement row(database, "SELECT coalesce(sum(bytes), 0) FROM (" + std::string(referenced) + ")");
    row.step();
    return row.integer(0);
}

enum class Kind { checkpoints, result, surface };

struct Evictable {
    Kind kind;
    std::string key;  // runs_hash, job_hash or sha256
};

// Checkpoints before anything else: they only save time.
std::vector<Evictable> least_recently_used(Database& database) {
    Statement rows(
        database,
        "SELECT kind, key FROM (SELECT 0 AS kind, runs_hash AS key, max(last_used) AS used FROM checkpoints "
        "AS c WHERE NOT EXISTS(SELECT 1 "
        "FROM jobs WHERE runs_hash=c.runs_hash AND status IN ('accepted', 'running')) GROUP BY runs_hash "
        "UNION ALL SELECT 1, job_hash, max(last_used) FROM results AS r WHERE NOT EXISTS(SELECT 1 FROM jobs "
        "WHERE job_hash=r.job_hash AND status IN ('accepted', 'running')) GROUP BY job_hash "
        "UNION ALL SELECT 2, sha256, last_used FROM surfaces AS s WHERE NOT EXISTS(SELECT 1 FROM "
        "job_surfaces JOIN jobs ON sequence=job WHERE sha256=s.sha256 AND status IN ('accepted', "
        "'running'))) ORDER BY min(kind, 1), used");
    std::vector<Evictable> list;
    while (rows.step()) list.push_back({static_cast<Kind>(rows.integer(0)), rows.text(1)});
    return list;
}

// Bytes to which nothing points any more.
int64_t evict(Database& database, const Evictable& victim, int64_t at) {
    const std::string table = victim.kind == Kind::checkpoints ? "checkpoints WHERE runs_hash=?"
                              : victim.kind == Kind::result    ? "results WHERE job_hash=?"
                                                               : "surfaces WHERE sha256=?";
    std::unordered_map<std::string, int64_t> objects;
    {
        Statement rows(database, "SELECT sha256, bytes FROM " + table, victim.key);
        while (rows.step()) objects[rows.text(0)] = rows.integer(1);
    }
    Statement(database, "DELETE FROM " + table, victim.key).run();
    if (victim.kind == Kind::result)
        Statement(database,
                  "UPDATE jobs SET expires=?, updated=?, version=version+1 "
                  "WHERE job_hash=? AND status='successful' AND expires IS NULL",
                  at, at, victim.key)
            .run();
    int64_t freed = 0;
    for (const auto& [sha256, bytes] : objects)
        if (!is_referenced(database, sha256)) freed += bytes;
    return freed;
}

GcReport evict_beyond(Database& database, int64_t quota, int64_t at) {
    GcReport report;
    report.bytes_before = report.bytes_after = kept_bytes(database);
    if (report.bytes_before <= quota) return report;
    for (const Evictable& victim : least_recently_used(database)) {
        if (report.bytes_after <= quota) break;
        report.bytes_after -= evict(database, victim, at);
        ++(victim.kind == Kind::checkpoints ? report.checkpointed
           : victim.kind == Kind::result    ? report.results
                                            : report.surfaces);
    }
    return report;
}

template <class Take>
void read_pieces(const OpenObject& object, const std::string& path, Take&& take) {
    std::string piece(size_t{1} << 20, '\0');
    for (;;) {
        const ssize_t n = ::read(object.file.get(), piece.data(), piece.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) fail_io(path, "cannot be read", errno);
        if (n == 0) return;
        take(std::string_view(piece.data(), static_cast<size_t>(n)));
    }
}

// What is wrong with it; empty if nothing is.
std::string fault_of(const Objects& objects, const std::string& sha256, int64_t bytes, bool deep) {
    const int64_t size = objects.size(sha256);
    if (size < 0) return "is missing";
    if (size != bytes) return "has " + std::to_string(size) + " bytes, not " + std::to_string(bytes);
    if (!deep) return "";
    Sha256 sum;
    try {
        read_pieces(objects.open(sha256), objects.path(sha256),
                    [&](std::string_view piece) { sum.update(piece); });
    } catch (const Error& error) {
        return error.what();
    }
    return sum.hex() == sha256 ? "" : "holds other bytes than its name says";
}

void check_database(Database& database, StoreCheck& report) {
    for (const char* pragma : {"PRAGMA integrity_check", "PRAGMA foreign_key_check"}) {
        Statement rows(database, pragma);
        while (rows.step())
            if (rows.text(0) != "ok") report.faults.push_back(std::string(pragma) + ": " + rows.text(0));
    }
    Statement empty(
        database,
        "SELECT id FROM jobs AS j WHERE status='successful' AND expires IS NULL AND NOT EXISTS(SELECT 1 "
        "FROM results WHERE job_hash=j.job_hash)");
    while (empty.step()) report.faults.push_back("job " + empty.text(0) + ": is successful without a result");
}

}  // namespace

GcReport Store::gc(int64_t quota_bytes) {
    const int64_t at = now();
    GcReport report =
        writer_.run([&](Database& database) { return evict_beyond(database, quota_bytes, at); });

    // The rows are gone for good; now the files. In the writer's thread, so that no row comes meanwhile, and
    // a few at a time, so that others get their turn.
    std::vector<std::string> suspects;
    readers_.read([&](Database& database) {
        objects_.for_each([&](const std::string& sha256, int64_t) {
            if (!is_referenced(database, sha256)) suspects.push_back(sha256);
        });
        return true;
    });
    constexpr size_t batch = 64;
    for (size_t first = 0; first < suspects.size(); first += batch) {
        const size_t end = std::min(suspects.size(), first + batch);
        writer_.run_alone([&](Database& database) {
            for (size_t k = first; k < end; ++k)
                if (!is_referenced(database, suspects[k]) && objects_.remove_unless_pinned(suspects[k]))
                    ++report.objects;
            return true;
        });
    }
    return report;
}

StoreCheck Store::check(bool deep) {
    StoreCheck report;
    std::unordered_map<std::string, int64_t> rows;
    readers_.read([&](Database& database) {
        check_database(database, report);
        Statement list(database, referenced);
        while (list.step()) rows[list.text(0)] = list.integer(1);
        return true;
    });
    report.rows = static_cast<int64_t>(rows.size());
    for (const auto& [sha256, bytes] : rows) {
        const std::string fault = fault_of(objects_, sha256, bytes, deep);
        if (fault.empty()) continue;
        // Unless its row went too while we looked.
        if (readers_.read([&, &name = sha256](Database& database) { return is_referenced(database, name); }))
            report.faults.push_back("object " + sha256 + ": " + fault);
    }
    objects_.for_each([&](const std::string& sha256, int64_t) {
        ++report.objects;
        if (!rows.contains(sha256)) ++report.orphans;
    });
    return report;
}

void Store::export_job(const std::string& id, const std::string& folder) {
    const std::optional<StoredJob> job = find(id);
    if (!job) throw Error(ErrorCode::not_found, "job", id, "is not in the store");
    make_folder(folder);
    const std::string text = *document(id);
    write_file_atomically(folder + "/document.json", [&](std::ostream& out) { out << text; });
    std::string sums = sha256_hex(text) + "  document.json\n";
    for (const ResultOutput& output : results(job->job_hash)) {
        const OpenObject object = objects_.open(output.sha256);
        write_file_atomically(folder + "/" + output.name, [&](std::ostream& out) {
            Sha256 sum;
            read_pieces(object, objects_.path(output.sha256), [&](std::string_view piece) {
                sum.update(piece);
                out << piece;
            });
            if (sum.hex() != output.sha256)
                throw Error(ErrorCode::io, objects_.path(output.sha256), "",
                            "holds other bytes than its name says");
        });
        sums += output.sha256 + "  " + output.name + "\n";
    }
    write_file_atomically(folder + "/SHA256SUMS", [&](std::ostream& out) { out << sums; });
}

}  // namespace gonio
