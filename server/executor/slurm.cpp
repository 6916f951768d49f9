#include "server/executor/slurm.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "server/executor/command.h"

namespace gonio {
namespace {

using nlohmann::json;

// sbatch and scancel wait up to 9 s for a controller that is down.
constexpr std::chrono::seconds limit{30};

constexpr std::array over = {"COMPLETED", "CANCELLED", "FAILED",   "TIMEOUT",      "NODE_FAIL",
                             "PREEMPTED", "BOOT_FAIL", "DEADLINE", "OUT_OF_MEMORY"};

// A text; since 23.02 a list of state and flags, in which a task that runs again is both COMPLETED and
// REQUEUED.
bool is_over(const json& state) {
    const std::vector<std::string> words =
        state.is_array() ? state.get<std::vector<std::string>>() : std::vector{state.get<std::string>()};
    return std::all_of(words.begin(), words.end(), [](const std::string& word) {
        return std::find(over.begin(), over.end(), word) != over.end();
    });
}

// A number; since 23.02 {"set": true, "number": 3}.
std::optional<int> array_position(const json& id) {
    if (id.is_number()) return id.get<int>();
    if (id.is_object() && id.at("set").get<bool>()) return id.at("number").get<int>();
    return std::nullopt;
}

// "1-3,7%2" -> 1 2 3 7
std::vector<int> expanded(const std::string& ranges) {
    std::vector<int> positions;
    std::istringstream in(ranges.substr(0, ranges.find('%')));
    for (std::string range; std::getline(in, range, ',');) {
        const size_t dash = range.find('-');
        const int first = std::stoi(range),
                  last = dash == range.npos ? first : std::stoi(range.substr(dash + 1));
        for (int i = first; i <= last; ++i) positions.push_back(i);
    }
    return positions;
}

// Name and comment together are the job's own: the name carries its hash, the comment its folder.
std::optional<int> attempt_of(const json& task, const JobFolder& job) {
    const std::string prefix = job.name() + "-", name = task.at("name");
    int attempt = 0;
    if (!name.starts_with(prefix) || task.at("comment") != job.job()) return std::nullopt;
    const char* end = name.data() + name.size();
    if (std::from_chars(name.data() + prefix.size(), end, attempt).ptr != end) return std::nullopt;
    return attempt;
}

bool is_stuck(const json& task) {
    const auto why = task.find("state_description");
    return why != task.end() && why->is_string() && *why == "launch failed requeued held";
}

// All jobs of this user. SLURM_BITSTR_LEN: lists of waiting tasks are else cut after 64 characters.
std::optional<std::vector<SlurmTasks>> queued_tasks(const JobFolder& job) {
    const CommandResult squeue =
        run_command("SLURM_BITSTR_LEN=0 squeue --me --json --states=all 2>/dev/null", limit);
    if (squeue.exit_code == 127)
        throw Error(ErrorCode::not_found, "--executor", "slurm", "squeue is not there any more");
    return squeue.exit_code == 0 ? find_slurm_tasks(squeue.output, job) : std::nullopt;
}

}  // namespace

std::optional<std::vector<SlurmTasks>> find_slurm_tasks(const std::string& answer, const JobFolder& job) {
    try {
        std::vector<SlurmTasks> found;
        const json root = json::parse(answer);
        for (const json& task : root.at("jobs")) {
            const std::optional<int> attempt = attempt_of(task, job);
            if (!attempt || is_over(task.at("job_state"))) continue;
            const std::optional<int> position = array_position(task.at("array_task_id"));
            found.push_back({task.at("job_id"), *attempt,
                             position ? std::vector{*position} : expanded(task.at("array_task_string")),
                             is_stuck(task)});
        }
        return found;
    } catch (const std::exception&) {  // cut short, or not what squeue prints
        return std::nullopt;
    }
}

SlurmExecutor::SlurmExecutor(const ExecutorOptions& options) : options_(options) {
    const CommandResult sbatch = run_command("sbatch --version 2>&1", limit);
    if (sbatch.exit_code != 0)
        throw Error(ErrorCode::not_found, "--executor", "slurm", "sbatch does not answer: " + sbatch.output);
}

void SlurmExecutor::submit(const JobFolder& job, const Submission& submission) {
    const std::string attempt = std::to_string(submission.attempt),
                      task = "exec " + shell_quoted(job.script()) + " " +
                             shell_quoted(job.list(submission.attempt)) + " \"$SLURM_ARRAY_TASK_ID\"";
    const CommandResult sbatch = run_command(
        "sbatch --parsable --job-name=" + job.name() + "-" + attempt + " --comment=" +
            shell_quoted(job.job()) + " --array=1-" + std::to_string(submission.indices.size()) +
            (options_.at_once > 0 ? "%" + std::to_string(options_.at_once) : "") +
            " --cpus-per-task=" + std::to_string(options_.threads) +
            " --requeue --open-mode=append --export=NONE --chdir=" + shell_quoted(job.dispatch()) +
            " --output=log-" + attempt + "-%a --wrap=" + shell_quoted(task) + " 2>&1",
        limit);
    if (sbatch.exit_code != 0)
        throw Error(ErrorCode::io, "sbatch", "", "refuses the shards: " + sbatch.output);
}

std::optional<std::set<int>> SlurmExecutor::poll(const JobFolder& job) {
    const std::optional<std::vector<SlurmTasks>> tasks = queued_tasks(job);
    if (!tasks) return std::nullopt;
    std::set<int> shards;
    for (const SlurmTasks& found : *tasks) {
        if (found.is_stuck) continue;
        const std::vector<int> indices = job.submitted(found.attempt);
        for (const int position : found.positions)
            if (position >= 1 && position <= static_cast<int>(indices.size()))
                shards.insert(indices[position - 1]);
    }
    return shards;
}

void SlurmExecutor::cancel(const JobFolder& job) {
    const std::optional<std::vector<SlurmTasks>> tasks = queued_tasks(job);
    if (!tasks)
        throw Error(ErrorCode::io, "squeue", "",
                    "does not answer: end what is queued with scancel --name=" + job.name() + "-<attempt>");
    for (const SlurmTasks& found : *tasks) {
        // By name, too: the number may be another's by now.
        const CommandResult scancel =
            run_command("scancel --name=" + job.name() + "-" + std::to_string(found.attempt) + " " +
                            std::to_string(found.job_id) + " 2>&1",
                        limit);
        if (scancel.exit_code != 0) throw Error(ErrorCode::io, "scancel", "", "refuses: " + scancel.output);
    }
}

}  // namespace gonio
