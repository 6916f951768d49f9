// What the store asks of the file system: syncs that cannot fail quietly, folders, one owner a folder.
#pragma once
#include <string>
#include <string_view>

namespace gonio {

// Deliberate defects, for the tests that must catch them: a library of its own is built with
// GONIO_STORE_MUTANTS and reads the environment; in gonio's own build this is the constant false.
#ifdef GONIO_STORE_MUTANTS
bool mutant(std::string_view name);
#else
constexpr bool mutant(std::string_view) {
    return false;
}
#endif

// Error(io) that names the file or folder and what the system said (`error`: an errno).
[[noreturn]] void fail_io(const std::string& path, const std::string& action, int error);

class FileDescriptor {
  public:
    FileDescriptor() = default;
    explicit FileDescriptor(int fd) : fd_(fd) {}
    FileDescriptor(FileDescriptor&& other) noexcept : fd_(other.release()) {}
    FileDescriptor& operator=(FileDescriptor&& other) noexcept;
    ~FileDescriptor();
    int get() const { return fd_; }
    int release();
    explicit operator bool() const { return fd_ >= 0; }

  private:
    int fd_ = -1;
};

// Says why on stderr and aborts. After a failed fsync the kernel may have dropped the pages and marked them
// clean: a second fsync would report a success that is none. The write-ahead log, read anew, knows better.
[[noreturn]] void die_of_lost_sync(const std::string& path, const std::string& reason);

void sync_or_die(int fd, const std::string& path);
void sync_folder_or_die(const std::string& folder);

// Made with mode 0700 where it is missing; true if it was.
bool make_folder(const std::string& folder);

// Holds `folder`/lock for as long as it lives; throws Error(io) if another process has it. flock, not a file
// with a pid in it: the kernel takes it back however the process ends.
class FolderLock {
  public:
    explicit FolderLock(const std::string& folder);

  private:
    FileDescriptor file_;
};

}  // namespace gonio
