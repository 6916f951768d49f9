// The list of executors. Another is a file like slurm.cpp and a line here.
#include "server/executor/command_template.h"
#include "server/executor/executor.h"
#include "server/executor/local.h"
#include "server/executor/slurm.h"

namespace gonio {

std::unique_ptr<Executor> make_executor(const std::string& which, const ExecutorOptions& options) {
    if (which == "local") return std::make_unique<LocalExecutor>(options);
    if (which == "slurm") return std::make_unique<SlurmExecutor>(options);
    return std::make_unique<CommandTemplateExecutor>(which, options);
}

}  // namespace gonio
