#include "server/executor/command_template.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "base/error.h"
#include "server/executor/command.h"
#include "server/json_node.h"

namespace gonio {
namespace {

constexpr std::chrono::seconds limit{60};
constexpr double default_poll_seconds = 5;
// A submission must name its shards by one of them.
constexpr const char* submit_words[] = {"{list}", "{indices}", "{index}"};

using Values = CommandTemplateExecutor::Values;

// Replaces {word} where the word is known. Other braces are the shell's own: ${x}, {1..3}, awk's.
std::string filled(const std::string& command, const Values& values) {
    std::string text;
    for (size_t i = 0; i < command.size();) {
        const size_t end = command[i] == '{' ? command.find('}', i) : command.npos;
        const auto value =
            end == command.npos ? values.end() : values.find(command.substr(i + 1, end - i - 1));
        if (value == values.end()) {
            text += command[i++];
        } else {
            text += value->second;
            i = end + 1;
        }
    }
    return text;
}

void run_or_throw(const std::string& member, const std::string& command, const Values& values) {
    const CommandResult result = run_command("(" + filled(command, values) + "\n) 2>&1", limit);
    if (result.exit_code != 0)
        throw Error(ErrorCode::io, "/" + member, command,
                    "ended with exit code " + std::to_string(result.exit_code) + ": " + result.output);
}

std::string joined(const std::vector<int>& indices) {
    std::string text;
    for (const int index : indices) text += (text.empty() ? "" : ",") + std::to_string(index);
    return text;
}

nlohmann::json read_templates(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in)
        throw Error(ErrorCode::not_found, "--executor", path,
                    "must be local, slurm or a file of command templates; there is no such file");
    return parse_json_strictly(std::string{std::istreambuf_iterator<char>(in), {}});
}

}  // namespace

CommandTemplateExecutor::CommandTemplateExecutor(const std::string& path, const ExecutorOptions& options)
    : here_(shell_quoted(std::filesystem::absolute(path).parent_path().string())), options_(options) {
    const nlohmann::json file = read_templates(path);
    const JsonNode root(file, path + "#");
    root.allow_keys({"submit", "poll", "cancel", "poll_seconds"});
    submit_ = root.at("submit").text();
    poll_ = root.at("poll").text();
    cancel_ = root.at("cancel").text();
    if (std::none_of(std::begin(submit_words), std::end(submit_words),
                     [&](const char* word) { return submit_.find(word) != submit_.npos; }))
        root.at("submit").refuse("must say which shards by {list}, {indices} or {index}");
    const auto seconds = root.find("poll_seconds");
    poll_interval_ = std::chrono::milliseconds(
        std::lround(1000 * (seconds ? seconds->number(0.01, 3600) : default_poll_seconds)));
}

CommandTemplateExecutor::Values CommandTemplateExecutor::values_of(const JobFolder& job) const {
    return {{"name", job.name()},
            {"folder", shell_quoted(job.dispatch())},
            {"run", shell_quoted(job.script())},
            {"job", shell_quoted(job.document())},
            {"here", here_},
            {"at_once", std::to_string(options_.at_once)},
            {"threads", std::to_string(options_.threads)}};
}

void CommandTemplateExecutor::submit(const JobFolder& job, const Submission& submission) {
    Values values = values_of(job);
    values["list"] = shell_quoted(job.list(submission.attempt));
    values["count"] = std::to_string(submission.indices.size());
    values["indices"] = joined(submission.indices);
    values["attempt"] = std::to_string(submission.attempt);
    if (submit_.find("{index}") == submit_.npos) return run_or_throw("submit", submit_, values);
    for (const int index : submission.indices) {
        values["index"] = std::to_string(index);
        run_or_throw("submit", submit_, values);
    }
}

std::optional<std::set<int>> CommandTemplateExecutor::poll(const JobFolder& job) {
    const CommandResult result = run_command(filled(poll_, values_of(job)), limit);
    if (result.exit_code != 0) return std::nullopt;
    std::set<int> shards;
    std::istringstream in(result.output);
    for (int index; in >> index;) shards.insert(index);
    if (!in.eof())  // a message in place of numbers
        return std::nullopt;
    return shards;
}

void CommandTemplateExecutor::cancel(const JobFolder& job) {
    run_or_throw("cancel", cancel_, values_of(job));
}

}  // namespace gonio
