// What executors start, what they make of the answers, and what a shard leaves in the shared folder.
#include "server/executor/executor.h"

#include "executor_fixture.h"
#include "server/executor/command.h"
#include "server/executor/slurm.h"

namespace gonio {
namespace {

using std::chrono::seconds;

TEST(Command, IsRunWithinItsTime) {
    EXPECT_EQ(run_command("echo one; echo two >&2; exit 3", seconds(60)).output, "one\n");
    EXPECT_EQ(run_command("exit 3", seconds(60)).exit_code, 3);
    EXPECT_EQ(run_command("sleep 1000", seconds(1)).exit_code, 124);
    EXPECT_EQ(run_command("nosuchprogram 2>/dev/null", seconds(60)).exit_code, 127);
    const std::string hostile = "it's $HOME `ls` \\ \"x\"\n;";
    EXPECT_EQ(run_command("printf %s " + shell_quoted(hostile), seconds(60)).output, hostile);
}

class JobFolderTest : public ExecutorTest {
  protected:
    // Runs shard 5 with a program that does this.
    int run_shard(const std::string& program) const {
        return run_command(shell_quoted(folder(script("program", program)).script()) + " 5 2>/dev/null",
                           seconds(120))
            .exit_code;
    }
};

TEST_F(JobFolderTest, ListsAreNumberedAndCanBeReadAgain) {
    const JobFolder job = folder();
    EXPECT_EQ(job.new_submission({0, 7, 8}).attempt, 1);
    EXPECT_EQ(folder().new_submission({3}).attempt, 2) << "an earlier start's submissions count";
    EXPECT_EQ(job.submitted(1), (std::vector{0, 7, 8}));
    EXPECT_EQ(job.submitted(3), std::vector<int>{});
}

TEST_F(JobFolderTest, InputsAreCopied) {
    std::filesystem::create_directories(root / "a b");
    std::ofstream(root / "a b/heights.txt") << "0 1\n1 0\n";
    const std::string document =
        R"({"surface": {"file": "heights.txt", "pitch": "1 mm", "height_scale": "1 mm"},
        "material": {"model": "lambertian", "albedo": 0.5},
        "measure": {"kind": "brdf", "incident": {"hemisphere": 2}, "outgoing": {"hemisphere": 3}}})";
    const LoadedJob job = load_job(parse_job(document, {"heights", root / "a b"}));
    const JobFolder copied(root / "shared", job, document, root / "a b", {"gonio", 1}, {});
    std::filesystem::remove_all(root / "a b");
    EXPECT_EQ(load_job(parse_job(read(copied.document()), {"job", copied.dispatch()})).hash, job.hash);
    EXPECT_THROW(JobFolder(root / "shared", job, document, root / "a b", {"gonio", 1}, {}), Error);
}

TEST_F(JobFolderTest, AShardIsCalledAsTheJobWants) {
    loaded.reference = ReferenceOptions{512};
    const std::string program = script("program", "printf '%s|' \"$PWD\" \"$@\" > \"$0.called\"");
    RunOptions options;
    options.max_bytes = 3LL << 29;
    options.allow_skips = false;
    const JobFolder job(root / "shared", loaded, small_job, ".", {program, 4, true}, options);
    job.new_submission({11, 22});
    const std::string run = shell_quoted(job.script());
    ASSERT_EQ(run_command(run + " " + shell_quoted(job.list(1)) + " 2", seconds(60)).exit_code, 0);
    EXPECT_EQ(read(program + ".called"),
              job.dispatch() + "|shard|--job|job.json|--index|22|--checkpoints|" + job.shared() +
                  "|--quiet|--threads|4|--max-memory|1.5|--no-skip|--untrusted|--reference|512|");
}

TEST_F(JobFolderTest, FailuresAreKeptWithWhatWasSaid) {
    EXPECT_EQ(run_shard("echo 'no room' >&2; echo 'at all' >&2; exit 6"), 6);
    const auto failure = folder().failure(5);
    ASSERT_TRUE(failure);
    EXPECT_EQ(failure->exit_code, 6);
    EXPECT_EQ(failure->message, "no room\nat all");
    EXPECT_FALSE(folder().failure(4));
    folder().forget_failure(5);
    EXPECT_FALSE(folder().failure(5));
    EXPECT_EQ(run_shard("exit 1"), 1);
    EXPECT_TRUE(folder().failure(5)) << "also without a message";
}

TEST_F(JobFolderTest, SuccessAndStopsAreNoFailures) {
    EXPECT_EQ(run_shard("exit 0"), 0);
    for (const char* stop : {"5", "143"}) EXPECT_EQ(run_shard(std::string("exit ") + stop), std::stoi(stop));
    EXPECT_EQ(run_shard("kill -9 $$"), 137);
    EXPECT_FALSE(folder().failure(5));
}

TEST_F(JobFolderTest, ShardsThatAreNotSeenYetAreWaitedFor) {
    EXPECT_EQ(run_shard("[ -e \"$0.seen\" ] && exit 0; touch \"$0.seen\"; exit 7"), 0);
    EXPECT_FALSE(folder().failure(5));
}

// Programs of the names that an executor calls, found before the real ones.
class FakesTest : public ExecutorTest {
  protected:
    FakesTest() : path_(std::getenv("PATH")) {
        ::setenv("PATH", ((root / "bin").string() + ":" + path_).c_str(), 1);
        script("sbatch", "printf '%s|' \"$@\" >> '" + log("sbatch") + "'");
        script("scancel", "printf '%s|' \"$@\" >> '" + log("scancel") + "'");
    }
    ~FakesTest() override { ::setenv("PATH", path_.c_str(), 1); }
    // A path without the quote that the folder's name has.
    std::string log(const std::string& name) {
        if (logs_.empty()) {
            std::string folder = (std::filesystem::temp_directory_path() / "gonio-log-XXXXXX").string();
            if (!::mkdtemp(folder.data())) throw std::runtime_error("no temporary folder");
            logs_ = folder;
        }
        return logs_ + "/" + name;
    }
    void TearDown() override { std::filesystem::remove_all(logs_); }

  private:
    std::string path_, logs_;
};

// What squeue says of one task; `id` is the text of its array members.
std::string task(const JobFolder& job, const std::string& name, const std::string& state,
                 const std::string& id) {
    return R"({"job_id": 17, "name": ")" + name + R"(", "comment": ")" + job.job() + R"(", "job_state": )" +
           state + ", " + id + "}";
}
const std::string
    second = R"("array_task_id": 2, "array_task_string": "")",
    second_since_23 =
        R"("array_task_id": {"set": true, "infinite": false, "number": 2}, "array_task_string": "")",
    waiting = R"("array_task_id": null, "array_task_string": "1,3-4%2")",
    waiting_since_23 = R"("array_task_id": {"set": false, "number": 0}, "array_task_string": "1,3-4%2")";

TEST_F(FakesTest, SlurmTasksAreKnownByNameAndComment) {
    const JobFolder job = folder(), elsewhere(root / "other", loaded, small_job, ".", {"gonio", 1}, {});
    const std::string name = job.name() + "-3";
    const auto positions = [&](const std::string& tasks) {
        const auto found = find_slurm_tasks(R"({"jobs": [)" + tasks + "]}", job);
        return found && !found->empty() ? found->front().positions : std::vector<int>{};
    };
    for (const char* state : {R"("PENDING")", R"("RUNNING")", R"("COMPLETING")", R"("REQUEUED")",
                              R"(["RUNNING"])", R"(["COMPLETED", "REQUEUED"])"}) {
        EXPECT_EQ(positions(task(job, name, state, second)), std::vector{2}) << state;
        EXPECT_EQ(positions(task(job, name, state, second_since_23)), std::vector{2}) << state;
        EXPECT_EQ(positions(task(job, name, state, waiting)), (std::vector{1, 3, 4})) << state;
        EXPECT_EQ(positions(task(job, name, state, waiting_since_23)), (std::vector{1, 3, 4})) << state;
    }
    for (const char* state :
         {R"("COMPLETED")", R"("CANCELLED")", R"("FAILED")", R"("TIMEOUT")", R"("NODE_FAIL")",
          R"("PREEMPTED")", R"("BOOT_FAIL")", R"("DEADLINE")", R"("OUT_OF_MEMORY")", R"(["CANCELLED"])"})
        EXPECT_EQ(positions(task(job, name, state, second)), std::vector<int>{}) << state;
    const auto stuck =
        find_slurm_tasks(R"({"jobs": [)" +
                             task(job, name, R"("PENDING")",
                                  second + R"(, "state_description": "launch failed requeued held")") +
                             "]}",
                         job);
    EXPECT_TRUE(stuck->front().is_stuck);
    // The same number, but somebody else's by now.
    EXPECT_EQ(positions(task(job, "other", R"("RUNNING")", second)), std::vector<int>{});
    EXPECT_EQ(positions(task(job, name + "x", R"("RUNNING")", second)), std::vector<int>{});
    EXPECT_EQ(positions(task(elsewhere, name, R"("RUNNING")", second)), std::vector<int>{})
        << "the same job in another folder";
}

TEST_F(FakesTest, AnAnswerThatSlurmDoesNotGiveIsUnknown) {
    const JobFolder job = folder();
    const auto slurm = make_executor("slurm", {});
    for (const char* answer : {"exit 1", "exit 124", "echo slurm_load_jobs error; exit 0",
                               "printf '{\"jobs\": ['", "echo '{}'", "echo '{\"jobs\": []}'; exit 1"}) {
        script("squeue", answer);
        EXPECT_FALSE(slurm->poll(job)) << answer;
        EXPECT_THROW(slurm->cancel(job), Error) << answer;
    }
    script("squeue", "echo '{\"jobs\": []}'");
    EXPECT_EQ(slurm->poll(job), std::set<int>{});
    script("squeue", "exit 127");
    EXPECT_THROW(slurm->poll(job), Error);
    EXPECT_EQ(read(log("scancel")), "");
}

TEST_F(FakesTest, SlurmIsAskedForTheMissingShards) {
    const JobFolder job = folder();
    const auto slurm = make_executor("slurm", {5, 2});
    std::filesystem::remove(log("sbatch"));
    slurm->submit(job, job.new_submission({4, 9, 30}));
    const std::string arguments = read(log("sbatch"));
    for (const std::string& wanted :
         {std::string("--parsable|"), "--job-name=" + job.name() + "-1|", "--comment=" + job.job() + "|",
          std::string("--array=1-3%5|"), std::string("--cpus-per-task=2|"),
          std::string("--requeue|--open-mode=append|--export=NONE|")})
        EXPECT_NE(arguments.find(wanted), arguments.npos) << wanted << " in " << arguments;

    std::ofstream(log("answer")) << R"({"jobs": [)" << task(job, job.name() + "-1", R"("RUNNING")", second)
                                 << "," << task(job, job.name() + "-1", R"("PENDING")", waiting) << "]}";
    script("squeue", "cat '" + log("answer") + "'");
    EXPECT_EQ(slurm->poll(job), (std::set{4, 9, 30})) << "positions are lines of the list; 4 is none";
    slurm->cancel(job);
    EXPECT_EQ(read(log("scancel")), "--name=" + job.name() + "-1|17|--name=" + job.name() + "-1|17|");

    script("sbatch", "echo 'invalid partition' >&2; exit 1");
    try {
        slurm->submit(job, job.new_submission({1}));
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find("invalid partition"), std::string::npos);
    }
}

class TemplateTest : public ExecutorTest {
  protected:
    std::unique_ptr<Executor> executor(const std::string& text) const {
        std::ofstream(root / "engine.json") << text;
        return make_executor(root / "engine.json", {3, 2});
    }
    std::string refusal(const std::string& text) const {
        try {
            executor(text);
        } catch (const Error& error) {
            return error.what();
        }
        return "";
    }
};

TEST_F(TemplateTest, WordsAreFilledIn) {
    const JobFolder job = folder();
    const auto engine = executor(
        R"({"submit": "printf '%s|' {name} {attempt} {count} {indices} {list} {run} {folder} {job} {at_once} )"
        R"({threads} {here} ${HOME} {other} > {folder}/submitted", "poll": "echo 4; echo 9 30", "cancel": "touch {folder}/{name}"})");
    engine->submit(job, job.new_submission({4, 9, 30}));
    EXPECT_EQ(read(job.dispatch() + "/submitted"),
              job.name() + "|1|3|4,9,30|" + job.list(1) + "|" + job.script() + "|" + job.dispatch() + "|" +
                  job.document() + "|3|2|" + root.string() + "|" + std::getenv("HOME") + "|{other}|");
    EXPECT_EQ(engine->poll(job), (std::set{4, 9, 30}));
    engine->cancel(job);
    EXPECT_TRUE(std::filesystem::exists(job.dispatch() + "/" + job.name()));
    EXPECT_EQ(engine->poll_interval(), seconds(5));
}

TEST_F(TemplateTest, AnIndexMeansOneCommandForEach) {
    const JobFolder job = folder();
    const auto engine = executor(
        R"({"submit": "echo {index} >> {folder}/submitted", "poll": "true", "cancel": "true", "poll_seconds": 0.5})");
    engine->submit(job, job.new_submission({4, 9}));
    EXPECT_EQ(read(job.dispatch() + "/submitted"), "4\n9\n");
    EXPECT_EQ(engine->poll_interval(), std::chrono::milliseconds(500));
}

TEST_F(TemplateTest, FailingCommands) {
    const JobFolder job = folder();
    const auto says = [&](const std::string& poll) {
        return executor(R"({"submit": "echo full; exit 1 # {list}", "poll": ")" + poll +
                        R"(", "cancel": "exit 1"})")
            ->poll(job);
    };
    EXPECT_FALSE(says("exit 1"));
    EXPECT_FALSE(says("echo 4; exit 1"));
    EXPECT_FALSE(says("echo 4 cannot connect"));
    EXPECT_EQ(says("echo"), std::set<int>{});
    const auto engine =
        executor(R"({"submit": "echo full; exit 1 # {list}", "poll": "true", "cancel": "exit 1"})");
    EXPECT_THROW(engine->submit(job, job.new_submission({4})), Error);
    EXPECT_THROW(engine->cancel(job), Error);
}

TEST_F(TemplateTest, FilesAreCheckedBeforeAnythingRuns) {
    EXPECT_NE(refusal(R"({"submit": "x {list}", "poll": "x"})").find("cancel"), std::string::npos);
    EXPECT_NE(refusal(R"({"submit": "x", "poll": "x", "cancel": "x"})").find("{indices}"), std::string::npos);
    EXPECT_NE(refusal(R"({"submit": "x {list}", "poll": "x", "cancel": "x", "pol_seconds": 1})")
                  .find("pol_seconds"),
              std::string::npos);
    EXPECT_NE(refusal(R"({"submit": "x {list}", "poll": "x", "cancel": "x", "poll_seconds": 0})")
                  .find("poll_seconds"),
              std::string::npos);
    EXPECT_NE(refusal("[").find("line"), std::string::npos);
    EXPECT_THROW(make_executor("nosuchexecutor", {}), Error);
}

}  // namespace
}  // namespace gonio
