// Options that several subcommands share.
#pragma once
#include <functional>
#include <list>
#include <string>
#include <vector>

#include "measure/plan.h"
#include "server/compose_job.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace gonio {

struct CommonOptions {
    bool quiet = false;    // nothing but errors on stderr
    bool json = false;     // results and failures as JSON on stdout
    bool dry_run = false;  // parse, read and check everything, run nothing
    bool no_skip = false;
    int threads = 1;  // add_run_options sets the default: every hardware thread
    double max_memory_gib = 6;
    std::string folder = ".";  // of relative outputs
    std::string checkpoints;   // folder where finished shards are kept; empty: nowhere

    RunOptions run_options() const;
};

// --quiet, --json
void add_output_options(CLI::App& command, CommonOptions& common);
// The above and --threads, --no-skip, --max-memory, --dry-run
void add_run_options(CLI::App& command, CommonOptions& common);

// An option that is a key of the job document: how its value becomes JSON.
enum class JobFlagKind {
    text,    // as it is
    json,    // a number or a word of JSON
    list,    // "0,15,30" -> [0, 15, 30]
    present  // no value: true
};
struct JobFlag {
    std::string flag;     // "--width"
    std::string pointer;  // "/surface/width"
    JobFlagKind kind;
    std::string help;
    std::string group;
};

// Adds job flags to a subcommand and gives those that were used back as entries of a job document.
class JobFlags {
  public:
    void add(CLI::App& command, const std::vector<JobFlag>& flags);
    // Names a flag that is read elsewhere but stands for a part of the document, for flag_for.
    void name(const std::string& pointer, const std::string& flag) { names_.emplace_back(pointer, flag); }
    std::vector<JobEntry> entries() const;
    // "--width" for the pointer "/surface/width"; the pointer itself if no flag stands for it.
    std::string flag_for(const std::string& pointer) const;

  private:
    struct Value {
        JobFlag flag;
        std::string text;
        CLI::Option* option = nullptr;
    };
    std::list<Value> values_;  // CLI11 keeps the addresses
    std::vector<std::pair<std::string, std::string>> names_;
};

// SURFACE or --generate, with every key of "/surface".
void add_surface_flags(CLI::App& command, JobFlags& flags);

// Runs `action`; an Error about a value that came from a flag then names the flag.
int with_flag_names(const JobFlags& flags, const std::function<int()>& action);

}  // namespace gonio
