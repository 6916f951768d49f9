#include "server/store/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "base/error.h"

namespace gonio {

#ifdef GONIO_STORE_MUTANTS
bool mutant(std::string_view name) {
    static const char* const chosen = std::getenv("GONIO_STORE_MUTANT");
    return chosen && name == chosen;
}
#endif

void fail_io(const std::string& path, const std::string& action, int error) {
    throw Error(ErrorCode::io, path, "", action + ": " + std::strerror(error));
}

FileDescriptor& FileDescriptor::operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
}

FileDescriptor::~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
}

int FileDescriptor::release() {
    return std::exchange(fd_, -1);
}

void die_of_lost_sync(const std::string& path, const std::string& reason) {
    std::fprintf(stderr,
                 "gonio: %s: cannot be synced to the disk (%s); stopping, so that nothing is promised that "
                 "may be lost\n",
                 path.c_str(), reason.c_str());
    std::abort();
}

void sync_or_die(int fd, const std::string& path) {
    if (mutant("no_fsync")) return;
    if (::fsync(fd) != 0) die_of_lost_sync(path, std::strerror(errno));
}

void sync_folder_or_die(const std::string& folder) {
    const FileDescriptor fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!fd) fail_io(folder, "cannot be opened", errno);
    sync_or_die(fd.get(), folder);
}

bool make_folder(const std::string& folder) {
    if (::mkdir(folder.c_str(), 0700) == 0) return true;
    if (errno != EEXIST) fail_io(folder, "cannot be made", errno);
    return false;
}

FolderLock::FolderLock(const std::string& folder) {
    const std::string path = folder + "/lock";
    file_ = FileDescriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
    if (!file_) fail_io(path, "cannot be opened", errno);
    if (::flock(file_.get(), LOCK_EX | LOCK_NB) == 0) return;
    if (errno != EWOULDBLOCK) fail_io(path, "cannot be locked", errno);
    throw Error(ErrorCode::io, folder, "",
                "belongs to another running process; a store has one owner at a time");
}

}  // namespace gonio
