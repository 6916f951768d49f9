// A measurement cut into shards: its random runs, or the views of the path tracer. A shard depends on the job
// and on its number alone, so it may be computed anywhere, twice, or again after a crash, and what is put
// together is the same to the last bit as if one process had done it all. (Not with max_seconds, which asks
// the clock.)
#pragma once
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace gonio {

// Where finished parts are kept, under keys that say what decided them: a part serves every job of which it
// is a part. Both may be called from several threads at once.
class Checkpoints {
  public:
    virtual ~Checkpoints() = default;
    // Nothing if there is no such part. What is returned is what was saved, whole.
    virtual std::optional<std::string> load(const std::string& key) = 0;
    virtual void save(const std::string& key, const std::string& bytes) = 0;
};

// What a process does about shards that are not there yet.
struct ShardTask {
    enum class Kind { compute_all, compute_one, compute_none };
    Kind kind = Kind::compute_all;
    int index = 0;  // for compute_one
};

struct Shard {
    int index;        // in the order in which a measurement comes to need them
    std::string key;  // under which it is kept: a name for a file
};

// Thrown by compute_none, and by compute_one if its shard cannot be planned before these are there.
class MissingShards : public std::exception {
  public:
    explicit MissingShards(std::vector<Shard> which);
    const std::vector<Shard>& shards() const { return shards_; }
    const char* what() const noexcept override { return text_.c_str(); }

  private:
    std::vector<Shard> shards_;
    std::string text_;
};

// Thrown by compute_one when its shard is there.
class ShardDone : public std::exception {
  public:
    const char* what() const noexcept override { return "the shard is done"; }
};

// The shards of one measurement, numbered in the order in which it comes to need them.
class Shards {
  public:
    Shards(Checkpoints* checkpoints, const ShardTask& task) : checkpoints_(checkpoints), task_(task) {}

    // The next shards, by their keys.
    struct Batch {
        int first = 0;
        std::vector<std::string> keys;
        std::vector<std::optional<std::string>> saved;  // what is there already
        std::vector<int> to_compute;                    // positions 0 .. n - 1
    };
    Batch take(std::vector<std::string> keys);
    // A shard that was computed; from any thread.
    void save(const Batch& batch, int position, const std::string& bytes);
    // After the last save of a batch.
    void finish(const Batch& batch) const;

    // A part that is no shard: every process may make it for itself, but need not make it twice.
    std::string part(const std::string& key, const std::function<std::string()>& compute);

    bool are_kept() const { return checkpoints_ != nullptr; }

  private:
    Checkpoints* checkpoints_;
    ShardTask task_;
    int taken_ = 0;
};

}  // namespace gonio
