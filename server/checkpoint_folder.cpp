#include "server/checkpoint_folder.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>

#include "base/error.h"
#include "base/sha256.h"
#include "server/job_hash.h"
#include "base/atomic_file.h"

namespace gonio {
namespace {

std::string file_of(const std::string& folder, const std::string& key) {
    return (std::filesystem::path(folder) / key).string();
}

// One line before the bytes: what wrote them, and their hash.
std::string header_of(const std::string& bytes) {
    return "gonio-checkpoint " + program_version() + " " + sha256_hex(bytes) + "\n";
}

}  // namespace

CheckpointFolder::CheckpointFolder(const std::string& folder, const std::string& job_hash)
    : folder_((std::filesystem::path(folder) / job_hash).string()) {}

std::optional<std::string> CheckpointFolder::load(const std::string& key) {
    std::ifstream in(file_of(folder_, key), std::ios::binary);
    std::string header;
    if (!std::getline(in, header)) return std::nullopt;
    std::string bytes{std::istreambuf_iterator<char>(in), {}};
    if (header + "\n" != header_of(bytes)) return std::nullopt;
    return bytes;
}

void CheckpointFolder::save(const std::string& key, const std::string& bytes) {
    std::error_code failure;
    std::filesystem::create_directories(folder_, failure);
    if (failure) throw Error(ErrorCode::io, folder_, "", "cannot be made: " + failure.message());
    write_file_atomically(file_of(folder_, key),
                          [&](std::ostream& out) { out << header_of(bytes) << bytes; });
}

void CheckpointFolder::remove_all() const {
    std::error_code ignored;  // what is left costs room, no correctness
    std::filesystem::remove_all(folder_, ignored);
}

}  // namespace gonio
