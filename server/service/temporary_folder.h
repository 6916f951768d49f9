// A folder that is gone with all that is in it when this is, also when the disk was full.
#pragma once
#include <filesystem>

namespace gonio {

class TemporaryFolder {
  public:
    TemporaryFolder();  // throws Error(io)
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

}  // namespace gonio
