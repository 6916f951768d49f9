// Shards as array tasks of Slurm, through its command line, which is the same at every site.
#pragma once
#include "server/executor/executor.h"

namespace gonio {

// Tasks are recognised by name and comment, never by number: after a crash of its controller Slurm gives the
// numbers of jobs that it lost to others. Partition, account, memory and time limit are those of the
// environment (SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_MEM_PER_CPU, SBATCH_TIMELIMIT).
class SlurmExecutor : public Executor {
  public:
    // Throws Error(not_found) where Slurm is not installed.
    explicit SlurmExecutor(const ExecutorOptions& options);

    void submit(const JobFolder& job, const Submission& submission) override;
    std::optional<std::set<int>> poll(const JobFolder& job) override;
    void cancel(const JobFolder& job) override;
    std::chrono::milliseconds poll_interval() const override { return std::chrono::seconds(5); }

  private:
    ExecutorOptions options_;
};

// A task of ours in the answer of `squeue --json`; arrays that wait stand there as one.
struct SlurmTasks {
    long long job_id = 0;
    int attempt = 0;
    std::vector<int> positions;  // lines of the submission's list, from 1
    bool is_stuck = false;       // its node could not start it, and Slurm will not try again by itself
};
// Those of the job that are not over. Nothing if it is no answer of squeue. Reads what 22.05 and later print.
std::optional<std::vector<SlurmTasks>> find_slurm_tasks(const std::string& answer, const JobFolder& job);

}  // namespace gonio
