#include "server/store/sqlite.h"

#include <sqlite3.h>

#include <chrono>
#include <thread>
#include <utility>

#include "base/error.h"
#include "server/store/files.h"

namespace gonio {
namespace {

constexpr int busy_ms = 10000;

bool is_lost_sync(int extended_code) {
    return extended_code == SQLITE_IOERR_FSYNC || extended_code == SQLITE_IOERR_DIR_FSYNC;
}

}  // namespace

Database::Database(const std::string& path, Access access) : path_(path) {
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::milliseconds(busy_ms);
    for (;;) {
        try {
            open(access);
            return;
        } catch (const Error&) {
            const bool busy = handle_ && (sqlite3_errcode(handle_) & 0xff) == SQLITE_BUSY;
            sqlite3_close(std::exchange(handle_, nullptr));
            if (!busy || std::chrono::steady_clock::now() > give_up) throw;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
}

void Database::open(Access access) {
    // SQLite's statistics of its memory would make every allocation of every connection wait for one lock.
    static const int configured = sqlite3_config(SQLITE_CONFIG_MEMSTATUS, 0);
    static_cast<void>(configured);
    // NOMUTEX: a connection is used by one thread at a time; this saves a lock per call.
    const int flags =
        SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE |
        (access == Access::write ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY);
    if (const int code = sqlite3_open_v2(path_.c_str(), &handle_, flags, nullptr))
        fail(code, "cannot be opened");
    sqlite3_busy_timeout(handle_, busy_ms);
    execute("PRAGMA foreign_keys=ON");
    if (access == Access::read) return;
    execute("PRAGMA journal_mode=WAL");
    execute(mutant("synchronous_normal") ? "PRAGMA synchronous=NORMAL" : "PRAGMA synchronous=FULL");
    execute("PRAGMA wal_autocheckpoint=0");
    // The checkpoint at closing drops its errors as well, and the log is as good a place as the database.
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
    sqlite3_wal_hook(
        handle_,
        [](void* log_pages, sqlite3*, const char*, int pages) {
            *static_cast<int*>(log_pages) = pages;
            return SQLITE_OK;
        },
        &log_pages_);
}

Database::Database(Database&& other) noexcept
    : path_(std::move(other.path_)), handle_(std::exchange(other.handle_, nullptr)) {}

Database::~Database() {
    sqlite3_close(handle_);
}

void Database::fail(int code, const std::string& action) const {
    const std::string reason = handle_ ? sqlite3_errmsg(handle_) : sqlite3_errstr(code);
    if (is_lost_sync(code)) die_of_lost_sync(path_, reason);
    throw Error(ErrorCode::io, path_, "", action + ": " + reason + " (SQLite " + std::to_string(code) + ")");
}

void Database::execute(const char* sql) {
    if (const int code = sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr)) fail(code, "cannot be used");
}

int64_t Database::changed_rows() const {
    return sqlite3_changes64(handle_);
}

int64_t Database::total_changes() const {
    return sqlite3_total_changes64(handle_);
}

bool Database::in_transaction() const {
    return sqlite3_get_autocommit(handle_) == 0;
}

void Database::checkpoint_if_above(int pages) {
    if (log_pages_ <= pages) return;
    const int code = sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr);
    if (is_lost_sync(code)) fail(code, "cannot be checkpointed");
    // Any other failure (a full disk) costs nothing but a longer log: the next commit tries again.
    if (code == SQLITE_OK) log_pages_ = 0;
}

Statement::Statement(Database& database, std::string_view sql, Prepare) : database_(database) {
    if (const int code =
            sqlite3_prepare_v2(database.handle_, sql.data(), static_cast<int>(sql.size()), &handle_, nullptr))
        database_.fail(code, "cannot be asked");
}

Statement::~Statement() {
    sqlite3_finalize(handle_);
}

void Statement::check_bound(int code) {
    if (code != SQLITE_OK) database_.fail(code, "cannot take a value");
}

void Statement::bind(std::string_view value) {
    // A view without data would bind NULL.
    check_bound(sqlite3_bind_text64(handle_, ++bound_, value.data() ? value.data() : "", value.size(),
                                    SQLITE_TRANSIENT, SQLITE_UTF8));
}

void Statement::bind(int64_t value) {
    check_bound(sqlite3_bind_int64(handle_, ++bound_, value));
}

void Statement::bind_null() {
    check_bound(sqlite3_bind_null(handle_, ++bound_));
}

bool Statement::step() {
    const int code = sqlite3_step(handle_);
    if (code == SQLITE_ROW) return true;
    if (code != SQLITE_DONE) database_.fail(code, "cannot be read or written");
    return false;
}

std::string Statement::text(int column) const {
    const auto* data = reinterpret_cast<const char*>(sqlite3_column_text(handle_, column));
    return data ? std::string(data, static_cast<size_t>(sqlite3_column_bytes(handle_, column)))
                : std::string();
}

int64_t Statement::integer(int column) const {
    return sqlite3_column_int64(handle_, column);
}

bool Statement::is_null(int column) const {
    return sqlite3_column_type(handle_, column) == SQLITE_NULL;
}

std::optional<std::string> Statement::optional_text(int column) const {
    return is_null(column) ? std::nullopt : std::optional(text(column));
}

std::optional<int64_t> Statement::optional_integer(int column) const {
    return is_null(column) ? std::nullopt : std::optional(integer(column));
}

Database Readers::take() {
    {
        const std::lock_guard lock(mutex_);
        if (!idle_.empty()) {
            Database database = std::move(idle_.back());
            idle_.pop_back();
            return database;
        }
    }
    return Database(path_, Database::Access::read);
}

Readers::Lease::Lease(Readers& from) : readers(from), database(from.take()) {
    database.execute("BEGIN");
}

Readers::Lease::~Lease() {
    try {
        database.execute("ROLLBACK");
        const std::lock_guard lock(readers.mutex_);
        readers.idle_.push_back(std::move(database));
    } catch (const std::exception&) {
        // A connection that cannot end its transaction is closed, not kept.
    }
}

}  // namespace gonio
