#include "clients/cli/execute.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>

#include "base/text.h"
#include "clients/cli/console.h"
#include "clients/cli/interrupt.h"
#include "server/checkpoint_folder.h"
#include "server/result_json.h"

namespace gonio {

std::string read_text(const std::string& path) {
    if (path == "-") return {std::istreambuf_iterator<char>(std::cin), {}};
    std::error_code failure;
    if (!std::filesystem::exists(path, failure)) throw Error(ErrorCode::not_found, path, "", "no such file");
    if (std::filesystem::is_directory(path, failure)) {
        throw Error(ErrorCode::invalid_input, path, "", "is a folder, not a file");
    }
    std::ifstream in(path, std::ios::binary);
    std::string text{std::istreambuf_iterator<char>(in), {}};
    if (!in) throw Error(ErrorCode::io, path, "", "cannot be read");
    return text;
}

JobOrigin origin_of(const std::string& path) {
    if (path == "-") return {};
    const std::filesystem::path file(path);
    return {file.stem().string(), file.parent_path().string()};
}

Job read_job(const std::string& path) {
    return parse_job(read_text(path), origin_of(path));
}

Report run_and_write(const LoadedJob& loaded, const std::vector<OutputRequest>& files,
                     const CommonOptions& common, const ShardTask& task, const RunJob& run) {
    Monitor monitor;
    monitor.cancel_requested = &interrupt_requested();
    ProgressBar bar(common.quiet);
    monitor.on_progress = [&](const Progress& progress) { bar.update(progress); };
    CheckpointFolder checkpoints(common.checkpoints, loaded.hash);
    RunOptions options = common.run_options();
    options.shard_task = task;
    if (!common.checkpoints.empty()) options.checkpoints = &checkpoints;
    Report report = run(loaded, files, options, monitor);
    if (!common.checkpoints.empty()) checkpoints.remove_all();
    return report;
}

void print_result(const LoadedJob& loaded, const Report& report, const std::vector<OutputRequest>& files,
                  const CommonOptions& common) {
    if (!common.quiet) {
        print_report(report, std::cerr);
        for (const OutputRequest& file : files) std::cerr << "wrote " << file.path << std::endl;
    }
    if (common.json) std::cout << result_json(loaded, report, files) << std::endl;
}

int execute_job(const Job& job, const CommonOptions& common,
                const std::optional<ReferenceOptions>& reference) {
    const LoadedJob loaded = load_job(job, reference);
    if (!common.quiet) print_surface(loaded.surface, std::cerr);
    if (common.dry_run) {
        std::cout << planned_json(loaded) << std::endl;
        return 0;
    }
    const std::vector<OutputRequest> files = output_files(loaded, common.folder);
    const Report report = run_and_write(loaded, files, common);
    print_result(loaded, report, files, common);
    return 0;
}

std::string this_program() {
    std::error_code failure;
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", failure);
    if (failure) throw Error(ErrorCode::io, "/proc/self/exe", "", failure.message());
    return program.string();
}

int exit_code(ErrorCode code) {
    switch (code) {
        case ErrorCode::usage:
            return 2;
        case ErrorCode::invalid_input:
        case ErrorCode::missing_unit:
        case ErrorCode::not_found:
            return 3;
        case ErrorCode::cancelled:
            return cancelled_exit_code();
        case ErrorCode::unreachable:
            return 4;
        case ErrorCode::limit:
            return 6;
        case ErrorCode::io:
        case ErrorCode::internal:
            return 1;
    }
    return 1;
}

}  // namespace gonio
