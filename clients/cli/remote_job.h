// The job document of the command line, run by a service.
#pragma once
#include "clients/cli/options.h"
#include "clients/cli/remote.h"
#include "server/job.h"

namespace gonio {

struct RemoteOptions {
    std::string server, token_file;
    RemoteService service() const { return RemoteService(server, token_file); }
};
// --server (or GONIO_SERVER), --token-file (or GONIO_TOKEN_FILE)
void add_remote_options(CLI::App& command, RemoteOptions& remote);

struct SubmittedJob {
    Job job;              // as `gonio run` reads it
    nlohmann::json info;  // statusInfo
};
// Checks the document as `gonio run` does, uploads the files that it names, submits it.
SubmittedJob submit_job(RemoteService& service, const std::string& path);

// Waits with a progress bar; Ctrl-C leaves the job to the service and says how to go on.
nlohmann::json wait_with_bar(RemoteService& service, const std::string& job, const CommonOptions& common);

// gonio run --server: the files that `gonio run` writes, with the same bytes.
int execute_remotely(const std::string& path, const RemoteOptions& remote, const CommonOptions& common);

}  // namespace gonio
