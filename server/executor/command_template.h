// Shards on any other engine, through three shell commands of a JSON file (examples in deploy/executors).
#pragma once
#include <map>

#include "server/executor/executor.h"

namespace gonio {

// Members of the file, and what stands in the commands for what:
//   submit  {list}      file of the submission: the numbers of its shards, one a line
//           {count}     how many
//           {indices}   the same numbers, separated by commas
//           {index}     if it appears, the command runs once for each shard
//           {attempt}   number of the submission; {name}-{attempt} is a good name for it
//   poll    prints the numbers of shards that are queued or running, separated by white space, and ends
//           with 0; another exit code says that it cannot know now
//   cancel  ends all that is queued or running
//   poll_seconds        from poll to poll, 0.01 to 3600, default 5
//   any of the three    {name}     "gonio-" and 12 digits of the job's hash
//                       {folder}   the job's folder (job_folder.h: where lists and logs lie)
//                       {run}      the script: {run} INDEX, or {run} LIST LINE
//                       {job}      the job document
//                       {here}     the folder of the file of templates
//                       {at_once}  at most so many at a time, 0: any number; {threads} of each shard
// Paths come quoted for the shell.
class CommandTemplateExecutor : public Executor {
  public:
    using Values = std::map<std::string, std::string>;  // words of the templates

    // Throws Error(not_found), Error(invalid_input) naming the file and the member.
    CommandTemplateExecutor(const std::string& path, const ExecutorOptions& options);

    void submit(const JobFolder& job, const Submission& submission) override;
    std::optional<std::set<int>> poll(const JobFolder& job) override;
    void cancel(const JobFolder& job) override;
    std::chrono::milliseconds poll_interval() const override { return poll_interval_; }

  private:
    Values values_of(const JobFolder& job) const;

    std::string here_, submit_, poll_, cancel_;
    std::chrono::milliseconds poll_interval_;
    ExecutorOptions options_;
};

}  // namespace gonio
