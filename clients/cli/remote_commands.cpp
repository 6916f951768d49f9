// Jobs on a service: gonio run --server, submit, status, wait, fetch, cancel, list.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "base/atomic_file.h"
#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "clients/cli/execute.h"
#include "clients/cli/interrupt.h"
#include "clients/cli/remote.h"
#include "clients/cli/remote_job.h"

namespace gonio {
namespace {

using nlohmann::json;

// A line for people, the service's own words for machines.
void print_status(const json& info, const CommonOptions& common) {
    if (common.json) {
        std::cout << info.dump(2) << std::endl;
        return;
    }
    std::cout << info.value("jobID", "") << "  " << info.value("status", "") << "  "
              << info.value("progress", 0) << " %  " << info.value("created", "") << "  "
              << info.value("message", "") << std::endl;
}

// Exit code of a job that ended: 0, 1 failed, 5 dismissed.
int outcome(const json& info) {
    const std::string status = info.value("status", "");
    return status == "successful" ? 0 : status == "dismissed" ? 5 : 1;
}

CLI::App* add_command(CLI::App& app, const char* name, const char* description, const char* footer,
                      RemoteOptions& remote, CommonOptions& common) {
    CLI::App* command = app.add_subcommand(name, description);
    command->footer(footer);
    add_remote_options(*command, remote);
    command->get_option("--server")->required();
    add_output_options(*command, common);
    return command;
}

struct JobOptions {
    RemoteOptions remote;
    std::string job, format = "csv", output = "table", folder = ".";
    int limit = 10;
};

using JobAction = int (*)(const JobOptions&, const CommonOptions&);

int show_status(const JobOptions& options, const CommonOptions& common) {
    print_status(options.remote.service().status(options.job), common);
    return 0;
}

int wait_for(const JobOptions& options, const CommonOptions& common) {
    RemoteService service = options.remote.service();
    const json info = wait_with_bar(service, options.job, common);
    print_status(info, common);
    return outcome(info);
}

int cancel(const JobOptions& options, const CommonOptions& common) {
    print_status(options.remote.service().cancel(options.job), common);
    return 0;
}

int fetch(const JobOptions& options, const CommonOptions& common) {
    RemoteService service = options.remote.service();
    std::filesystem::create_directories(options.folder);
    const std::string path =
        (std::filesystem::path(options.folder) / (options.job + "." + options.output + "." + options.format))
            .string();
    write_file_atomically(
        path, [&](std::ostream& out) { service.fetch(options.job, options.output, options.format, out); });
    if (common.json)
        std::cout << json{{"path", path}}.dump() << std::endl;
    else if (!common.quiet)
        std::cout << path << std::endl;
    return 0;
}

int list(const JobOptions& options, const CommonOptions& common) {
    const json jobs = options.remote.service().list(options.limit);
    if (common.json) {
        std::cout << jobs.dump(2) << std::endl;
        return 0;
    }
    for (const json& info : jobs.at("jobs")) print_status(info, common);
    return 0;
}

void add_job_command(CLI::App& app, CommonOptions& common, Action& action, const char* name,
                     const char* description, const char* footer, JobAction run) {
    const auto options = std::make_shared<JobOptions>();
    CLI::App* command = add_command(app, name, description, footer, options->remote, common);
    if (run == list) {
        command->add_option("--limit", options->limit, "Newest jobs shown")
            ->check(CLI::Range(1, 10000))
            ->capture_default_str();
    } else {
        command->add_option("JOB", options->job, "Id of the job, as submit printed it")->required();
    }
    if (run == fetch) {
        command->add_option("--output-id", options->output, "table or report")->capture_default_str();
        command->add_option("--format", options->format, "csv, json, exr")->capture_default_str();
        command->add_option("-o,--output", options->folder, "Folder of the file")->capture_default_str();
    }
    command->callback([options, run, &common, &action] {
        action = [options, run, &common] { return run(*options, common); };
    });
}

void add_submit(CLI::App& app, CommonOptions& common, Action& action) {
    const auto remote = std::make_shared<RemoteOptions>();
    const auto path = std::make_shared<std::string>();
    CLI::App* command = add_command(
        app, "submit", "Send a job to a service and come back at once",
        "  gonio submit lava.json --server http://host:8080      prints the id of the job", *remote, common);
    command->add_option("JOB", *path, "Job document (JSON); - reads stdin")->required();
    command->callback([remote, path, &common, &action] {
        action = [remote, path, &common] {
            RemoteService service = remote->service();
            const json info = submit_job(service, *path).info;
            if (common.json)
                std::cout << info.dump(2) << std::endl;
            else
                std::cout << info.value("jobID", "") << std::endl;
            return 0;
        };
    });
}

}  // namespace

void add_remote_commands(CLI::App& app, CommonOptions& common, Action& action) {
    add_submit(app, common, action);
    add_job_command(app, common, action, "status", "Show a job of a service",
                    "  gonio status ID --server http://host:8080", show_status);
    add_job_command(app, common, action, "wait", "Wait for the end of a job of a service",
                    "  gonio wait ID --server http://host:8080\nExit code 1: it failed, 5: it was cancelled.",
                    wait_for);
    add_job_command(app, common, action, "fetch", "Download a result from a service",
                    "  gonio fetch ID --server http://host:8080 --format exr -o results/", fetch);
    add_job_command(app, common, action, "cancel", "Cancel a job of a service",
                    "  gonio cancel ID --server http://host:8080", cancel);
    add_job_command(app, common, action, "list", "List your jobs of a service",
                    "  gonio list --server http://host:8080 --limit 50", list);
}

}  // namespace gonio
