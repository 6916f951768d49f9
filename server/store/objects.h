// Files named after the SHA-256 of what is in them: FOLDER/objects/ab/abcd.... Whoever finds an object under
// its name finds all of it, after a power cut too.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

#include "base/sha256.h"
#include "server/store/files.h"

namespace gonio {

// An object that is durable and, for as long as a copy of this lives, safe from remove_unless: what a row may
// point to. Only Objects makes one.
struct StoredObject {
    std::string sha256;
    int64_t bytes = 0;
    std::shared_ptr<const void> pin;
};

class Objects;

// Takes an object piece by piece. Dropped without finish, it leaves nothing behind.
class ObjectWriter {
  public:
    ObjectWriter(ObjectWriter&& other) noexcept;
    ~ObjectWriter();
    // Throws Error(io) naming the folder when the disk is full or fails.
    void write(std::string_view bytes);
    // Durable on return. With `expected_sha256`, throws Error(invalid_input) if something else was written.
    StoredObject finish(std::string_view expected_sha256 = {});

  private:
    friend class Objects;
    explicit ObjectWriter(Objects& objects);
    Objects* objects_;
    std::string temporary_;  // empty once renamed
    FileDescriptor file_;
    Sha256 sum_;
    int64_t bytes_ = 0;
};

struct OpenObject {
    FileDescriptor file;  // stays readable even if the object is removed meanwhile
    int64_t bytes;
};

class Objects {
  public:
    // Makes what is missing under `folder` and removes what unfinished writers of an earlier process left.
    explicit Objects(const std::string& folder);

    const std::string& folder() const { return folder_; }
    ObjectWriter writer() { return ObjectWriter(*this); }
    StoredObject put(std::string_view bytes);
    StoredObject put_file(const std::string& path);

    // Throw Error(not_found); a text that is no SHA-256 is never found.
    std::string path(std::string_view sha256) const;
    OpenObject open(std::string_view sha256) const;
    StoredObject pin(std::string_view sha256);
    // Its size, or -1.
    int64_t size(std::string_view sha256) const;
    bool exists(std::string_view sha256) const { return size(sha256) >= 0; }

    void for_each(const std::function<void(const std::string& sha256, int64_t bytes)>& visit) const;
    // Bytes freed; 0 if somebody is about to refer to it.
    int64_t remove_unless_pinned(const std::string& sha256);

  private:
    friend class ObjectWriter;
    std::string folder_of(std::string_view sha256) const;
    std::shared_ptr<const void> hold(const std::string& sha256);
    void place(const std::string& temporary, const std::string& sha256, int64_t bytes);

    void ensure_folder(const std::string& folder);

    std::string folder_;
    std::mutex folders_mutex_;  // held during the sync: who comes second must not be ahead of it
    std::unordered_set<std::string> durable_folders_;
    // Who will refer to an object pins it before looking whether it is there; who removes looks at the pins
    // and removes under the mutex. Shared, because a pin may outlive the store.
    struct Pins {
        std::mutex mutex;
        std::unordered_map<std::string, int> count;
    };
    std::shared_ptr<Pins> pins_ = std::make_shared<Pins>();
};

bool is_sha256(std::string_view text);

}  // namespace gonio
