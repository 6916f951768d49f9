// Finished shards of one job as files of a folder, which machines may share.
#pragma once
#include <string>

#include "measure/shards.h"

namespace gonio {

class CheckpointFolder : public Checkpoints {
  public:
    // The shards of the job of this hash lie in folder/<job_hash>. Made when the first is saved.
    CheckpointFolder(const std::string& folder, const std::string& job_hash);

    // A file that another version wrote, or that is damaged, counts as not there: it is computed again.
    std::optional<std::string> load(const std::string& key) override;
    // Whole or not at all, and durable (table/io/atomic_file.cpp). Throws Error(io).
    void save(const std::string& key, const std::string& bytes) override;
    // Once the result is written nobody needs them.
    void remove_all() const;

  private:
    std::string folder_;
};

}  // namespace gonio
