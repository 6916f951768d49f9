#include "server/store/objects.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <utility>

#include "base/error.h"

namespace gonio {
namespace {

namespace fs = std::filesystem;

int write_all(int fd, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(fd, bytes.data(), bytes.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) return errno;
        bytes.remove_prefix(static_cast<size_t>(written));
    }
    return 0;
}

[[noreturn]] void not_found(std::string_view sha256) {
    throw Error(ErrorCode::not_found, "object", std::string(sha256), "is not in the store");
}

// The defect that the tests must catch: the object grows under its final name.
void copy_in_place(const std::string& from, const std::string& to) {
    const FileDescriptor in(::open(from.c_str(), O_RDONLY | O_CLOEXEC));
    const FileDescriptor out(::open(to.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
    char piece[4096];
    for (ssize_t n; (n = ::read(in.get(), piece, sizeof piece)) > 0;)
        if (write_all(out.get(), {piece, static_cast<size_t>(n)}) != 0) return;
    sync_or_die(out.get(), to);
    ::unlink(from.c_str());
}

}  // namespace

bool is_sha256(std::string_view text) {
    return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) {
               return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
           });
}

ObjectWriter::ObjectWriter(Objects& objects) : objects_(&objects) {
    static std::atomic<uint64_t> counter{0};
    temporary_ = objects.folder_ + "/tmp/" + std::to_string(counter.fetch_add(1));
    file_ = FileDescriptor(::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    const int error = errno;
    if (file_) return;
    temporary_.clear();
    fail_io(objects.folder_, "an object cannot be written", error);
}

ObjectWriter::ObjectWriter(ObjectWriter&& other) noexcept
    : objects_(other.objects_),
      temporary_(std::exchange(other.temporary_, {})),
      file_(std::move(other.file_)),
      sum_(std::move(other.sum_)),
      bytes_(other.bytes_) {}

ObjectWriter::~ObjectWriter() {
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void ObjectWriter::write(std::string_view bytes) {
    if (const int error = write_all(file_.get(), bytes))
        fail_io(objects_->folder_, "an object cannot be written", error);
    sum_.update(bytes);
    bytes_ += static_cast<int64_t>(bytes.size());
}

StoredObject ObjectWriter::finish(std::string_view expected_sha256) {
    StoredObject object{sum_.hex(), bytes_, nullptr};
    if (!expected_sha256.empty() && expected_sha256 != object.sha256)
        throw Error(ErrorCode::invalid_input, "sha256", std::string(expected_sha256),
                    "what arrived has the SHA-256 " + object.sha256);
    // Not needed if the object is there already, but that is known for certain only in place().
    sync_or_die(file_.get(), temporary_);
    object.pin = objects_->hold(object.sha256);
    objects_->place(temporary_, object.sha256, bytes_);
    temporary_.clear();
    return object;
}

Objects::Objects(const std::string& folder) : folder_(folder) {
    const std::string objects = folder + "/objects", temporaries = folder + "/tmp";
    make_folder(objects);
    make_folder(temporaries);
    sync_folder_or_die(folder);
    for (const fs::directory_entry& leftover : fs::directory_iterator(temporaries)) {
        std::error_code failure;  // what cannot be removed now is met again at the next start
        fs::remove(leftover.path(), failure);
    }
}

StoredObject Objects::put(std::string_view bytes) {
    ObjectWriter writer(*this);
    writer.write(bytes);
    return writer.finish();
}

StoredObject Objects::put_file(const std::string& path) {
    ObjectWriter out = writer();
    std::ifstream in(path, std::ios::binary);
    std::string piece(size_t{1} << 20, '\0');
    while (in.read(piece.data(), static_cast<std::streamsize>(piece.size())), in.gcount() > 0)
        out.write({piece.data(), static_cast<size_t>(in.gcount())});
    if (!in.eof()) throw Error(ErrorCode::io, path, "", "cannot be read");
    return out.finish();
}

std::string Objects::folder_of(std::string_view sha256) const {
    return folder_ + "/objects/" + std::string(sha256.substr(0, 2));
}

std::string Objects::path(std::string_view sha256) const {
    if (!is_sha256(sha256)) not_found(sha256);
    return folder_of(sha256) + "/" + std::string(sha256);
}

OpenObject Objects::open(std::string_view sha256) const {
    FileDescriptor file(::open(path(sha256).c_str(), O_RDONLY | O_CLOEXEC));
    if (!file && errno == ENOENT) not_found(sha256);
    struct stat status;
    if (!file || ::fstat(file.get(), &status) != 0) fail_io(path(sha256), "cannot be opened", errno);
    return {std::move(file), status.st_size};
}

int64_t Objects::size(std::string_view sha256) const {
    struct stat status;
    if (!is_sha256(sha256) || ::stat(path(sha256).c_str(), &status) != 0) return -1;
    return status.st_size;
}

StoredObject Objects::pin(std::string_view sha256) {
    if (!is_sha256(sha256)) not_found(sha256);
    StoredObject object{std::string(sha256), 0, hold(std::string(sha256))};
    object.bytes = size(sha256);
    if (object.bytes < 0) not_found(sha256);
    return object;
}

std::shared_ptr<const void> Objects::hold(const std::string& sha256) {
    const std::lock_guard lock(pins_->mutex);
    ++pins_->count[sha256];
    return {static_cast<const void*>(pins_.get()), [pins = pins_, sha256](const void*) {
                const std::lock_guard release(pins->mutex);
                if (--pins->count[sha256] == 0) pins->count.erase(sha256);
            }};
}

void Objects::ensure_folder(const std::string& folder) {
    const std::lock_guard lock(folders_mutex_);
    if (durable_folders_.contains(folder)) return;
    // Synced even if it was there: the process that made it may have died before.
    make_folder(folder);
    sync_folder_or_die(folder_ + "/objects");
    durable_folders_.insert(folder);
}

void Objects::place(const std::string& temporary, const std::string& sha256, int64_t bytes) {
    const std::string target = path(sha256);
    ensure_folder(folder_of(sha256));
    // Renaming makes whatever has the name whole; the size is asked for as well so that an object that was
    // damaged by other means is mended when it comes again. The mutant goes without both.
    if (mutant("no_rename") ? exists(sha256) : size(sha256) == bytes) {
        ::unlink(temporary.c_str());
    } else if (mutant("no_rename")) {
        copy_in_place(temporary, target);
    } else if (::rename(temporary.c_str(), target.c_str()) != 0) {
        fail_io(folder_, "an object cannot be renamed into place", errno);
    }
    // Also for an object that was there: who renamed it may not have come to this line yet.
    sync_folder_or_die(folder_of(sha256));
}

void Objects::for_each(const std::function<void(const std::string&, int64_t)>& visit) const {
    for (const fs::directory_entry& folder : fs::directory_iterator(folder_ + "/objects")) {
        if (!folder.is_directory()) continue;
        for (const fs::directory_entry& file : fs::directory_iterator(folder.path())) {
            const std::string name = file.path().filename().string();
            const int64_t bytes = is_sha256(name) ? size(name) : -1;
            if (bytes >= 0) visit(name, bytes);
        }
    }
}

int64_t Objects::remove_unless_pinned(const std::string& sha256) {
    const std::lock_guard lock(pins_->mutex);
    const int64_t bytes = size(sha256);
    if (bytes < 0 || pins_->count.contains(sha256)) return 0;
    return ::unlink(path(sha256).c_str()) == 0 ? bytes : 0;
}

}  // namespace gonio
