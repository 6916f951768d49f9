// gonio batch: many jobs, one after the other. Each is given every thread; a job whose results are there
// already is left alone, so a batch that was stopped goes on where it was.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>

#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "clients/cli/execute.h"
#include "clients/cli/interrupt.h"
#include "server/result_json.h"

namespace gonio {
namespace {

struct BatchJob {
    std::string label;  // for messages: "jobs.jsonl:3", "lava.json"
    std::string path;   // of its file, read when its turn comes; empty if `text` is the document
    std::string text;
    JobOrigin origin;
};

struct BatchSummary {
    int done = 0, skipped = 0, failed = 0;
};

std::vector<BatchJob> jobs_of_folder(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> paths;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
        if (entry.path().extension() == ".json") paths.push_back(entry.path());
    }
    std::sort(paths.begin(), paths.end());
    std::vector<BatchJob> jobs;
    for (const auto& path : paths) {
        jobs.push_back(
            {path.filename().string(), path.string(), "", {path.stem().string(), folder.string()}});
    }
    return jobs;
}

// One document a line; outputs without a path are called after the line: jobs-3.csv.
std::vector<BatchJob> jobs_of_lines(const std::string& path) {
    std::istringstream lines(read_text(path));
    const std::filesystem::path file(path == "-" ? "stdin" : path);
    std::vector<BatchJob> jobs;
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
        if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
        jobs.push_back({file.filename().string() + ":" + std::to_string(number),
                        "",
                        line,
                        {file.stem().string() + "-" + std::to_string(number), file.parent_path().string()}});
    }
    return jobs;
}

std::vector<BatchJob> find_jobs(const std::string& path) {
    std::vector<BatchJob> jobs =
        std::filesystem::is_directory(path) ? jobs_of_folder(path) : jobs_of_lines(path);
    if (jobs.empty()) {
        throw Error(ErrorCode::invalid_input, path, "",
                    "holds no job: a folder of .json files or a file with one a line");
    }
    return jobs;
}

// Two jobs of one batch that write one file would be run again for ever, each spoiling the other's result.
void claim_files(std::map<std::string, std::string>& owners, const std::vector<OutputRequest>& files,
                 const std::string& label) {
    for (const OutputRequest& file : files) {
        const auto [owner, is_new] = owners.try_emplace(file.path, label);
        if (!is_new) {
            throw Error(ErrorCode::invalid_input, "/output", file.path,
                        "is written by " + owner->second + " already");
        }
    }
}

// One line of JSON for the job on stdout, one of text on stderr.
void tell(const CommonOptions& common, const std::string& label, const std::string& text,
          const std::string& json) {
    if (!common.quiet) std::cerr << label << ": " << text << std::endl;
    if (common.json) std::cout << json << std::endl;
}

void run_one(const BatchJob& batch_job, const CommonOptions& common,
             std::map<std::string, std::string>& owners, BatchSummary& summary) {
    const std::string text = batch_job.path.empty() ? batch_job.text : read_text(batch_job.path);
    const JsonStyle style{-1, batch_job.label};
    const LoadedJob loaded = load_job(parse_job(text, batch_job.origin));
    const std::vector<OutputRequest> files = output_files(loaded, common.folder);
    claim_files(owners, files, batch_job.label);
    const bool is_there = std::all_of(files.begin(), files.end(), [&](const OutputRequest& file) {
        return is_result_of(file.path, loaded.hash);
    });
    if (is_there) {
        ++summary.skipped;
        tell(common, batch_job.label, "skipped, its result is there", skipped_json(loaded, files, style));
        return;
    }
    if (common.dry_run) {
        tell(common, batch_job.label, "would run", planned_json(loaded, style));
        return;
    }
    if (!common.quiet) {
        for (const std::string& warning : loaded.surface.warnings)
            print_warning(batch_job.label + ": " + warning);
    }
    const Report report = run_and_write(loaded, files, common);
    ++summary.done;
    tell(common, batch_job.label, report.target_met ? "done" : "done, but the target error was not met",
         result_json(loaded, report, files, style));
}

int run_batch(const std::string& path, const CommonOptions& common) {
    const std::vector<BatchJob> jobs = find_jobs(path);
    BatchSummary summary;
    std::map<std::string, std::string> owners;
    bool cancelled = false;
    for (const BatchJob& job : jobs) {
        try {
            Monitor{{}, &interrupt_requested()}.check_cancelled();
            run_one(job, common, owners, summary);
        } catch (const Error& error) {
            cancelled = error.code() == ErrorCode::cancelled;
            if (cancelled) break;
            ++summary.failed;
            print_error(job.label + ": " + error.what());
            if (common.json) std::cout << failure_json(error, {-1, job.label}) << std::endl;
        }
    }
    const int left = static_cast<int>(jobs.size()) - summary.done - summary.skipped - summary.failed;
    if (!common.quiet) {
        std::cerr << jobs.size() << " jobs: " << summary.done << " done, " << summary.skipped << " skipped, "
                  << summary.failed << " failed, " << left << " not run" << std::endl;
    }
    if (cancelled) return cancelled_exit_code();
    return summary.failed ? 1 : 0;
}

}  // namespace

void add_batch(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command = app.add_subcommand("batch", "Run many jobs, skipping those whose results are there");
    command->footer(
        "  gonio batch jobs.jsonl -o results   one job document a line\n"
        "  gonio batch jobs/ -o results        every .json file of a folder\n"
        "A failed job does not stop the others; the exit code is then 1. Run it again to finish a batch that "
        "was stopped.");
    const auto path = std::make_shared<std::string>();
    command->add_option("JOBS", *path, "File with one job document a line (- reads stdin), or a folder")
        ->required();
    command->add_option("-o,--output", common.folder, "Folder of the outputs")->capture_default_str();
    add_run_options(*command, common);
    command->callback(
        [path, &common, &action] { action = [path, &common] { return run_batch(*path, common); }; });
}

}  // namespace gonio
