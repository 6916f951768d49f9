// gonio store check | gc | export: the data folder of a service that does not run.
#include "server/store/store.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/cli/commands.h"
#include "server/service/limits.h"

namespace gonio {
namespace {

using nlohmann::ordered_json;

struct StoreFlags {
    std::string data, job, folder;
    bool shallow = false;
    int64_t quota_bytes = ServiceLimits{}.stored_bytes;
};

int check(const StoreFlags& flags) {
    const StoreCheck report = Store({flags.data}).check(!flags.shallow);
    std::cout << ordered_json{{"faults", report.faults},
                              {"rows", report.rows},
                              {"objects", report.objects},
                              {"orphans", report.orphans}}
                     .dump(2)
              << std::endl;
    return report.faults.empty() ? 0 : 1;
}

int collect_garbage(const StoreFlags& flags) {
    const GcReport report = Store({flags.data}).gc(flags.quota_bytes);
    std::cout << ordered_json{{"bytes_before", report.bytes_before},
                              {"bytes_after", report.bytes_after},
                              {"checkpoints_removed", report.checkpointed},
                              {"results_removed", report.results},
                              {"surfaces_removed", report.surfaces},
                              {"objects_removed", report.objects}}
                     .dump(2)
              << std::endl;
    return 0;
}

int export_one(const StoreFlags& flags) {
    Store({flags.data}).export_job(flags.job, flags.folder);
    return 0;
}

}  // namespace

void add_store(CLI::App& app, CommonOptions&, Action& action) {
    CLI::App* store =
        app.add_subcommand("store", "Look after the data folder of a service that does not run");
    store->footer(
        "  gonio store check --data DIR                     every row, every file against its SHA-256\n"
        "  gonio store gc --data DIR --quota-bytes 50000000000\n"
        "  gonio store export ID --data DIR -o folder       document, outputs and SHA256SUMS of a job");
    store->require_subcommand(1);
    const auto flags = std::make_shared<StoreFlags>();
    auto add = [&](const char* name, const char* description, int (*run)(const StoreFlags&)) {
        CLI::App* command = store->add_subcommand(name, description);
        command->add_option("--data", flags->data, "Folder of jobs and results")
            ->required()
            ->check(CLI::ExistingDirectory);
        command->callback([flags, run, &action] { action = [flags, run] { return run(*flags); }; });
        return command;
    };
    add("check", "Look for damage; exit code 1 if there is any", check)
        ->add_flag("--shallow", flags->shallow, "Sizes only: do not read the files");
    add("gc", "Remove what is beyond the quota, and files that nothing needs", collect_garbage)
        ->add_option("--quota-bytes", flags->quota_bytes, "Of surfaces and results")
        ->capture_default_str();
    CLI::App* exported = add("export", "Copy a job and its results into a folder", export_one);
    exported->add_option("JOB", flags->job, "Id of the job")->required();
    exported->add_option("-o,--output", flags->folder, "The folder")->required();
}

}  // namespace gonio
