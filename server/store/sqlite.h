// SQLite as RAII: a connection, a statement. No more of its interface than the store uses.
#pragma once
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace gonio {

// One connection, used by one thread at a time. Everything throws Error(io) that names the file. A sync that
// failed inside SQLite aborts the process (files.h says why).
class Database {
  public:
    enum class Access { read, write };
    // Tried again for up to 10 s: while another connection recovers the log of a crashed process, SQLite
    // answers "busy" at once, whatever the busy timeout.
    Database(const std::string& path, Access access);
    Database(
        Database&& other) noexcept;  // of connections that read: the log's hook knows the writer's address
    ~Database();

    void execute(const char* sql);  // any number of statements without parameters
    int64_t changed_rows() const;   // by the last statement
    int64_t total_changes() const;  // since the connection was opened
    // False once SQLite has rolled a transaction back by itself, as it does when the disk is full.
    bool in_transaction() const;
    // Moves the log into the database if it has grown past `pages`. Ours and not SQLite's automatic one,
    // which drops the errors it meets.
    void checkpoint_if_above(int pages);
    const std::string& path() const { return path_; }

  private:
    friend class Statement;
    void open(Access access);
    [[noreturn]] void fail(int code, const std::string& action) const;
    std::string path_;
    sqlite3* handle_ = nullptr;
    int log_pages_ = 0;
};

// Parameters are bound in the order in which they come, columns read by their place.
class Statement {
  public:
    template <class... Values>
    Statement(Database& database, std::string_view sql, const Values&... values)
        : Statement(database, sql, Prepare{}) {
        (bind(values), ...);
    }
    ~Statement();
    Statement(const Statement&) = delete;
    Statement& operator=(const Statement&) = delete;

    void bind(std::string_view value);
    void bind(const std::string& value) { bind(std::string_view(value)); }
    void bind(const char* value) { bind(std::string_view(value)); }
    void bind(int64_t value);
    void bind(int value) { bind(int64_t{value}); }
    template <class T>
    void bind(const std::optional<T>& value) {
        value ? bind(*value) : bind_null();
    }

    bool step();  // true: a row to read; false: done
    void run() {  // to the end, whatever rows come
        while (step()) {
        }
    }
    std::string text(int column) const;
    int64_t integer(int column) const;
    bool is_null(int column) const;
    std::optional<std::string> optional_text(int column) const;
    std::optional<int64_t> optional_integer(int column) const;

  private:
    struct Prepare {};
    Statement(Database& database, std::string_view sql, Prepare);
    void bind_null();
    void check_bound(int code);
    Database& database_;
    sqlite3_stmt* handle_ = nullptr;
    int bound_ = 0;
};

// Read connections for any number of threads: taken, used, given back.
class Readers {
  public:
    explicit Readers(std::string path) : path_(std::move(path)) {}

    // use(Database&) on a connection that nobody else has, inside one transaction: it sees one state.
    template <class Use>
    auto read(Use&& use) {
        Lease lease(*this);
        return use(lease.database);
    }

  private:
    struct Lease {
        explicit Lease(Readers& from);
        ~Lease();
        Readers& readers;
        Database database;
    };
    Database take();
    std::string path_;
    std::mutex mutex_;
    std::vector<Database> idle_;
};

}  // namespace gonio
