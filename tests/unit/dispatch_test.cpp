// The loop that keeps a job's shards going, against an executor that loses, repeats, refuses and forgets.
#include "server/executor/dispatch.h"

#include <thread>

#include "executor_fixture.h"
#include "server/checkpoint_folder.h"

namespace gonio {
namespace {

using Submissions = std::vector<std::vector<int>>;

// Computes in place what is submitted to it, unless the test says otherwise. Its queue is what the test says.
class ScriptedExecutor : public Executor {
  public:
    ScriptedExecutor(const LoadedJob& loaded, const JobFolder& job) : loaded_(loaded), job_(job) {}

    void submit(const JobFolder&, const Submission& submission) override {
        submissions.push_back(submission.indices);
        if (on_submit) on_submit();
        for (const int index : submission.indices)
            if (!loses || !loses(index)) compute(index);
    }
    std::optional<std::set<int>> poll(const JobFolder&) override {
        ++polls;
        if (on_poll) return on_poll();
        return std::set<int>{};
    }
    void cancel(const JobFolder&) override { ++cancelled; }
    std::chrono::milliseconds poll_interval() const override { return std::chrono::milliseconds(1); }

    void compute(int index) const {
        CheckpointFolder checkpoints(job_.shared(), job_.job_hash());
        RunOptions options;
        options.checkpoints = &checkpoints;
        options.shard_task = {ShardTask::Kind::compute_one, index};
        EXPECT_THROW(run_brdf(loaded_, options), ShardDone);
    }
    void fail(int index, int exit_code) const {
        std::ofstream(job_.dispatch() + "/failed-" + std::to_string(index)) << exit_code << "\nno luck\n";
    }

    std::function<void()> on_submit;
    std::function<bool(int)> loses;  // shards that nothing becomes of
    std::function<std::optional<std::set<int>>()> on_poll;
    Submissions submissions;
    int polls = 0, cancelled = 0;

  private:
    const LoadedJob& loaded_;
    const JobFolder& job_;
};

class DispatchTest : public ExecutorTest {
  protected:
    void lose_first_shard() const {
        if (!std::filesystem::exists(job.job())) return;
        for (const auto& file : std::filesystem::directory_iterator(job.job()))
            if (file.path().filename().string().starts_with("stage0-run0-"))
                std::filesystem::remove(file.path());
    }
    Table run() { return dispatch(loaded, job, executor, {}, monitor, keep_queued).table; }
    void expect_the_table() {
        const Table expected = run_brdf(loaded, {}).table, table = run();
        EXPECT_EQ(table.f, expected.f);
        EXPECT_EQ(table.se, expected.se);
        EXPECT_EQ(table.provenance, expected.provenance);
    }
    Error error() {
        try {
            run();
        } catch (const Error& thrown) {
            return thrown;
        }
        ADD_FAILURE() << "nothing was thrown";
        return {ErrorCode::internal, "", "", ""};
    }

    JobFolder job = folder();
    ScriptedExecutor executor{loaded, job};
    Monitor monitor;
    std::atomic<bool>* keep_queued = nullptr;
    const std::vector<int> all = {0, 1, 2, 3};
};

TEST_F(DispatchTest, HasTheBitsOfOneProcess) {
    expect_the_table();
    EXPECT_EQ(executor.submissions, Submissions{all});
}

TEST_F(DispatchTest, WhatIsThereIsNotComputedAgain) {
    executor.compute(1);
    expect_the_table();
    EXPECT_EQ(executor.submissions, (Submissions{{0, 2, 3}}));
}

TEST_F(DispatchTest, WhatAnEarlierStartLeftInTheQueueIsWaitedFor) {
    executor.on_poll = [&]() -> std::optional<std::set<int>> {
        if (executor.polls < 5) return std::set{1, 2};
        for (const int index : {1, 2}) executor.compute(index);
        return std::set<int>{};
    };
    expect_the_table();
    EXPECT_EQ(executor.submissions, (Submissions{{0, 3}}));
}

TEST_F(DispatchTest, VanishedShardsAreSubmittedAgainAfterTwoPolls) {
    int polls_then = 0;
    executor.loses = [&](int index) { return executor.submissions.size() == 1 && index == 2; };
    executor.on_submit = [&] {
        if (executor.submissions.size() == 2) polls_then = executor.polls;
    };
    expect_the_table();
    EXPECT_EQ(executor.submissions, (Submissions{all, {2}}));
    EXPECT_EQ(polls_then, 3) << "submitted at the first poll, unseen at the second and the third";
}

TEST_F(DispatchTest, AShardThatIsSeenInBetweenIsNotLost) {
    executor.loses = [](int index) { return index == 2; };
    executor.on_poll = [&]() -> std::optional<std::set<int>> {
        if (executor.polls == 12) executor.compute(2);
        return executor.polls > 1 && executor.polls % 2 ? std::set{2} : std::set<int>{};
    };
    expect_the_table();
    EXPECT_EQ(executor.submissions, Submissions{all});
}

TEST_F(DispatchTest, AQueueThatDoesNotAnswerLosesNothing) {
    executor.loses = [](int index) { return index == 2; };
    executor.on_poll = [&]() -> std::optional<std::set<int>> {
        if (executor.polls == 40) executor.compute(2);
        return executor.polls == 5 ? std::optional(std::set<int>{}) : std::nullopt;
    };
    expect_the_table();
    EXPECT_EQ(executor.submissions, Submissions{all})
        << "not before it answers, and not again while it is silent";
    EXPECT_GE(executor.polls, 40);
}

TEST_F(DispatchTest, WhatNoOtherMachineWouldChangeIsNotTriedAgain) {
    for (const auto& [exit_code, code] :
         {std::pair{2, ErrorCode::usage}, {3, ErrorCode::invalid_input}, {6, ErrorCode::limit}}) {
        executor.loses = [&, exit_code = exit_code](int index) {
            return index == 2 ? executor.fail(2, exit_code), true : index == 3;
        };
        executor.submissions.clear();
        executor.cancelled = 0;
        lose_first_shard();
        const Error thrown = error();
        EXPECT_EQ(thrown.code(), code);
        EXPECT_NE(std::string(thrown.what())
                      .find("shard 2: failed with exit code " + std::to_string(exit_code) + ": no luck"),
                  std::string::npos)
            << thrown.what();
        EXPECT_EQ(executor.submissions.size(), 1u);
        EXPECT_EQ(executor.cancelled, 1) << "the others are not needed any more";
    }
}

TEST_F(DispatchTest, OtherFailuresAreTriedThreeTimes) {
    executor.loses = [&](int index) { return index == 2 ? executor.fail(2, 1), true : false; };
    const Error thrown = error();
    EXPECT_EQ(thrown.code(), ErrorCode::io);
    EXPECT_NE(std::string(thrown.what()).find("3 times; it failed with exit code 1: no luck"),
              std::string::npos)
        << thrown.what();
    EXPECT_EQ(executor.submissions, (Submissions{all, {2}, {2}}));
    // The third time it works, also where a failure of an earlier start is still there.
    executor.fail(2, 3);
    executor.submissions.clear();
    executor.loses = [&](int index) {
        return executor.submissions.size() < 3 ? executor.fail(index, 1), true : false;
    };
    expect_the_table();
    EXPECT_EQ(executor.submissions.size(), 3u);
}

TEST_F(DispatchTest, ShardsThatAlwaysVanishEndTheJob) {
    executor.loses = [](int index) { return index == 0; };
    const Error thrown = error();
    EXPECT_NE(std::string(thrown.what()).find("shard 0: was tried 3 times; it ended and left nothing"),
              std::string::npos)
        << thrown.what();
    EXPECT_EQ(executor.submissions.size(), 3u);
}

TEST_F(DispatchTest, RefusedSubmissionsAreTriedThreeTimes) {
    executor.on_submit = [&] {
        if (executor.submissions.size() < 3) throw Error(ErrorCode::io, "sbatch", "", "refuses");
    };
    expect_the_table();
    EXPECT_EQ(executor.submissions, (Submissions{all, all, all}));
    lose_first_shard();
    executor.submissions.clear();
    executor.on_submit = [] { throw Error(ErrorCode::io, "sbatch", "", "refuses"); };
    EXPECT_NE(std::string(error().what()).find("refuses"), std::string::npos);
    EXPECT_EQ(executor.submissions.size(), 3u);
}

TEST_F(DispatchTest, CancellingEndsWhatIsQueued) {
    std::atomic<bool> cancel{false}, keep{false};
    monitor.cancel_requested = &cancel;
    executor.loses = [](int) { return true; };
    executor.on_poll = [&]() -> std::optional<std::set<int>> {
        if (executor.polls == 3) cancel = true;
        return executor.polls > 1 ? std::set<int>(all.begin(), all.end()) : std::set<int>{};
    };
    EXPECT_EQ(error().code(), ErrorCode::cancelled);
    EXPECT_EQ(executor.cancelled, 1);
    // A service that stops leaves it.
    cancel = false;
    keep = true;
    keep_queued = &keep;
    executor.polls = 0;
    EXPECT_EQ(error().code(), ErrorCode::cancelled);
    EXPECT_EQ(executor.cancelled, 1);
}

TEST_F(DispatchTest, AClockCannotBeShared) {
    std::visit([](auto& plan) { plan.accuracy = {0.01, 5, {}, 1}; }, loaded.job.plan);
    EXPECT_EQ(error().field(), "/accuracy/max_seconds");
    EXPECT_EQ(executor.submissions.size(), 0u);
}

// The real thing once: script, processes, shared folder.
TEST_F(DispatchTest, LocalProcessesRunSoManyAtOnce) {
    // Stands in for `gonio shard`: notes how many run, and computes nothing.
    const std::string counting =
        script("program",
               "mkdir -p \"$0.d/$5\"; ls \"$0.d\" | wc -l >> \"$0.counts\"\n"
               "[ $(wc -l < \"$0.counts\") -lt 2 ] && sleep 1; rmdir \"$0.d/$5\"; exit 6");
    const JobFolder counted = folder(counting);
    const auto local = make_executor("local", {2, 1});
    local->submit(counted, counted.new_submission({5, 6, 7, 8, 9}));
    size_t most = 0;
    while (true) {
        const auto left = local->poll(counted);
        if (left->empty()) break;
        most = std::max(most, left->size());
        std::this_thread::sleep_for(local->poll_interval());
    }
    EXPECT_EQ(most, 5u) << "waiting ones are on their way, too";
    int count = 0, lines = 0, peak = 0;
    for (std::ifstream in(counting + ".counts"); in >> count; ++lines) peak = std::max(peak, count);
    EXPECT_EQ(lines, 5);
    EXPECT_EQ(peak, 2);
    EXPECT_EQ(counted.failure(7)->exit_code, 6);
}

TEST_F(DispatchTest, LocalProcessesAreEndedWithAllTheyStarted) {
    const std::string sleeping = script("program", "echo $$ >> \"$0.pids\"; exec sleep 1000");
    const JobFolder job_of_sleepers = folder(sleeping);
    const auto local = make_executor("local", {1, 1});
    local->submit(job_of_sleepers, job_of_sleepers.new_submission({0, 1}));
    local->poll(job_of_sleepers);
    while (read(sleeping + ".pids").empty()) std::this_thread::sleep_for(local->poll_interval());
    const pid_t pid = std::stoi(read(sleeping + ".pids"));
    local->cancel(job_of_sleepers);
    EXPECT_EQ(local->poll(job_of_sleepers), std::set<int>{});
    // Its parent is gone, so that init has to see to it: for a moment it may be there as a zombie.
    const std::string state = "/proc/" + std::to_string(pid) + "/cmdline";
    for (int i = 0; i < 600 && !read(state).empty(); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(read(state), "") << "empty for a zombie, too";
}

}  // namespace
}  // namespace gonio
