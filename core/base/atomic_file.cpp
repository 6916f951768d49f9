// Write aside, sync, rename (the order that survives a power cut: the data before the name, the name before
// the folder).
#include "base/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/error.h"

namespace gonio {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& path, const std::string& action, int error) {
    throw Error(ErrorCode::io, path, "", action + (error ? std::string(": ") + std::strerror(error) : ""));
}

// Pid and counter keep threads and processes apart; O_EXCL keeps machines and containers apart, which can
// share a folder and a pid.
std::string create_temporary(const fs::path& target) {
    static std::atomic<unsigned> counter{0};
    for (;;) {
        const fs::path temporary =
            target.parent_path() / ("." + target.filename().string() + "." + std::to_string(::getpid()) +
                                    "." + std::to_string(counter.fetch_add(1)) + ".tmp");
        const int fd = ::open(temporary.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
        if (fd >= 0) {
            struct stat old;  // a replaced file keeps its mode
            if (::stat(target.c_str(), &old) == 0) static_cast<void>(::fchmod(fd, old.st_mode & 07777));
            ::close(fd);
            return temporary.string();
        }
        if (errno != EEXIST) fail(target.string(), "cannot be written", errno);
    }
}

void sync(const std::string& path, int flags, const std::string& target) {
    const int fd = ::open(path.c_str(), flags | O_CLOEXEC);
    if (fd < 0) fail(target, "cannot be synced", errno);
    const int error = ::fsync(fd) == 0 ? 0 : errno;
    ::close(fd);
    // Some file systems cannot sync a folder and say so with EINVAL: nothing more can be done there.
    if (error && error != EINVAL) fail(target, "cannot be synced", error);
}

// Through a symbolic link to what it points at: renaming would replace the link itself.
fs::path resolve(const std::string& path) {
    std::error_code failure;
    if (path.empty()) throw Error(ErrorCode::io, "path", "", "is empty");
    fs::path target = fs::weakly_canonical(fs::absolute(path), failure);
    if (failure) target = fs::absolute(path);
    if (fs::is_directory(target, failure)) fail(path, "is a folder", 0);
    return target;
}

// Devices and pipes (/dev/stdout) have no folder to be renamed in.
bool is_stream(const fs::path& target) {
    std::error_code failure;
    const fs::file_status status = fs::status(target, failure);
    return fs::exists(status) && !fs::is_regular_file(status);
}

void write_stream(const fs::path& path, const std::string& name,
                  const std::function<void(std::ostream&)>& write) {
    errno = 0;
    std::ofstream out(path, std::ios::binary | std::ios::trunc);
    if (!out) fail(name, "cannot be written", errno);
    write(out);
    out.close();
    if (!out) fail(name, "cannot be written", errno);
}

}  // namespace

void write_path_atomically(const std::string& path, const std::function<void(const std::string&)>& write) {
    const fs::path target = resolve(path);
    if (is_stream(target)) fail(path, "this format needs a regular file", 0);
    const std::string temporary = create_temporary(target);
    try {
        write(temporary);
        sync(temporary, O_RDONLY, path);
        if (::rename(temporary.c_str(), target.c_str()) != 0)
            fail(path, "cannot be renamed into place", errno);
    } catch (...) {
        ::unlink(temporary.c_str());
        throw;
    }
    sync(target.parent_path().string(), O_RDONLY | O_DIRECTORY, path);
}

void write_file_atomically(const std::string& path, const std::function<void(std::ostream&)>& write) {
    // Asked of the path as given: the target of /dev/stdout can be a pipe, which has no path of its own.
    if (is_stream(path) && !fs::is_directory(path)) return write_stream(path, path, write);
    write_path_atomically(path, [&](const std::string& temporary) { write_stream(temporary, path, write); });
}

}  // namespace gonio
