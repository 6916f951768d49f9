#include "server/executor/job_folder.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>

#include "base/atomic_file.h"
#include "base/text.h"
#include "server/executor/command.h"
#include "server/json_node.h"

namespace gonio {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

void write_text(const std::string& path, const std::string& text) {
    write_file_atomically(path, [&](std::ostream& out) { out << text; });
}

// Copies the files that a document names to `folder` and lets it name the copies.
void copy_inputs(json& document, const fs::path& origin, const fs::path& folder) {
    int n_copied = 0;
    const auto copy = [&](json& name) {
        const fs::path from = origin / name.get<std::string>();
        // Some formats are known by their extension alone.
        const std::string copied = "input-" + std::to_string(n_copied++) + from.extension().string();
        write_path_atomically((folder / copied).string(), [&](const std::string& temporary) {
            std::error_code failure;
            fs::copy_file(from, temporary, fs::copy_options::overwrite_existing, failure);
            if (failure)
                throw Error(ErrorCode::io, from.string(), "", "cannot be copied: " + failure.message());
        });
        name = copied;
    };
    for (const char* pointer : {"/surface/file", "/material/albedo/file", "/material/albedo/files"}) {
        const json::json_pointer place(pointer);
        if (!document.contains(place)) continue;
        json& named = document[place];
        if (named.is_array())
            for (json& name : named) copy(name);
        else
            copy(named);
    }
}

// No threads of OpenBLAS, which spin for 30 ms a core when a process begins; and what decides, beside the
// processor, in which order it adds. Engines do not hand the environment on.
std::string blas_environment() {
    const char* chosen = std::getenv("OPENBLAS_CORETYPE");
    return "export OPENBLAS_NUM_THREADS=1\n" +
           (chosen ? "export OPENBLAS_CORETYPE=" + shell_quoted(chosen) + "\n" : std::string());
}

std::string script_of(const JobFolder& folder, const LoadedJob& job, const ShardCommand& command,
                      const RunOptions& options) {
    std::string shard =
        shell_quoted(command.program) + " shard --job job.json --index \"$index\" --checkpoints " +
        shell_quoted(folder.shared()) + " --quiet --threads " + std::to_string(command.threads) +
        " --max-memory " + number_text(static_cast<double>(options.max_bytes) / 0x1p30);
    if (!options.allow_skips) shard += " --no-skip";
    if (command.untrusted) shard += " --untrusted";
    if (job.reference) shard += " --reference " + std::to_string(job.reference->paths);
    return R"(#!/bin/sh
# Computes one shard: run INDEX, or run LIST LINE for the number in that line of a list.
)" + blas_environment() +
           R"(if [ $# = 2 ]; then index=$(sed -n "$2p" "$1"); else index=$1; fi
cd )" + shell_quoted(folder.dispatch()) +
           R"( || exit 1
for pause in 1 2 4 8 16 32 0; do
    message=$()" +
           shard + R"( 2>&1)
    code=$?
    # 7: shards before it are not seen yet; shared disks may show new files late on other machines.
    [ $code = 7 ] || break
    sleep $pause
done
[ $code = 0 ] && exit
printf '%s\n' "$message" >&2
# Stopped from outside is no failure of the shard.
case $code in 5 | 130 | 137 | 143) exit $code ;; esac
printf '%s\n%s\n' "$code" "$message" > ".failed-$index.$$" && mv ".failed-$index.$$" "failed-$index"
exit $code
)";
}

}  // namespace

JobFolder::JobFolder(const std::string& shared, const LoadedJob& job, const std::string& document,
                     const std::string& origin_folder, const ShardCommand& command, const RunOptions& options)
    : shared_(fs::absolute(shared).lexically_normal().string()), job_hash_(job.hash) {
    std::error_code failure;
    fs::create_directories(dispatch(), failure);
    if (failure) throw Error(ErrorCode::io, dispatch(), "", "cannot be made: " + failure.message());
    json copy = parse_json_strictly(document);
    copy_inputs(copy, origin_folder, dispatch());
    write_text(this->document(), copy.dump());
    write_text(script(), script_of(*this, job, command, options));
    fs::permissions(script(), fs::perms(0755), failure);
    if (failure) throw Error(ErrorCode::io, script(), "", "cannot be made executable: " + failure.message());
}

Submission JobFolder::new_submission(const std::vector<int>& indices) const {
    Submission submission{1, indices};
    while (fs::exists(list(submission.attempt))) ++submission.attempt;
    std::string text;
    for (const int index : indices) text += std::to_string(index) + "\n";
    write_text(list(submission.attempt), text);
    return submission;
}

std::vector<int> JobFolder::submitted(int attempt) const {
    std::ifstream in(list(attempt));
    return {std::istream_iterator<int>(in), {}};
}

std::optional<ShardFailure> JobFolder::failure(int index) const {
    std::ifstream in(dispatch() + "/failed-" + std::to_string(index));
    ShardFailure found;
    if (!(in >> found.exit_code)) return std::nullopt;
    in >> std::ws;
    found.message.assign(std::istreambuf_iterator<char>(in), {});
    while (found.message.ends_with('\n')) found.message.pop_back();
    return found;
}

void JobFolder::forget_failure(int index) const {
    std::error_code ignored;  // at worst it counts twice
    fs::remove(dispatch() + "/failed-" + std::to_string(index), ignored);
}

}  // namespace gonio
