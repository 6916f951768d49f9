// A kind of job that the service can do. A new kind is one file that makes a ServiceProcess and one line in
// processes.cpp.
#pragma once
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/monitor.h"
#include "measure/plan.h"
#include "measure/prediction.h"
#include "server/executor/executor.h"
#include "server/store/store.h"

namespace gonio {

struct OutputFormat {
    const char* suffix;  // of ?f=
    const char* media_type;
};

struct ProcessOutput {
    std::string name, title;
    std::vector<OutputFormat> formats;  // stored as outputs "name.suffix"
};

// Where and with what a job is computed.
struct Workplace {
    Objects& objects;
    RunOptions options;
    const Monitor& monitor;
    // Of the shards, where jobs are computed elsewhere; null: in this process.
    Executor* executor = nullptr;
    std::string shared_folder;  // that all machines see
    ShardCommand shard_command;
    const std::atomic<bool>* ending = nullptr;  // the service ends: shards stay in their queue
};

// A job that was checked and whose surface is in memory.
struct PreparedJob {
    std::string job_hash;
    std::string runs_hash;  // equal for jobs that can have runs in common; empty: it has no checkpoints
    std::vector<std::string> surfaces;  // SHA-256 of what it reads in the store
    Prediction prediction;
    // A prediction for the same job at another target_relative_error; empty if it has none.
    std::function<Prediction(double target)> at_target;
    double target = 0;
    // Every output in every format. Throws Error, also cancelled.
    std::function<std::vector<NewOutput>(const Workplace&)> run;
};

struct ServiceProcess {
    std::string id, title, description;
    std::vector<std::string> inputs;  // members of the job document
    std::vector<std::string> required;
    nlohmann::json own_schemas;  // of inputs that the schema of the job document does not have
    std::vector<ProcessOutput> outputs;
    // `document` holds no other members than `inputs`, and all the required ones. Throws Error with pointers
    // into it. Reads uploaded files from `objects`, never another file.
    std::function<PreparedJob(const nlohmann::json& document, Objects& objects)> prepare;
};

}  // namespace gonio
