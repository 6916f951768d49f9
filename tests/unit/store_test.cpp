// The job store within one process; what happens when the process dies is in tests/end_to_end/store_*.
#include "server/store/store.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <set>
#include <thread>

#include "base/error.h"
#include "server/store/schema.h"

namespace gonio {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

std::string read_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

template <class Action>
ErrorCode code_of(Action&& action) {
    try {
        action();
    } catch (const Error& error) {
        return error.code();
    }
    ADD_FAILURE() << "nothing was refused";
    return ErrorCode::internal;
}

class StoreTest : public testing::Test {
  protected:
    StoreTest() {
        std::string name = (fs::temp_directory_path() / "gonio_store_XXXXXX").string();
        folder = ::mkdtemp(name.data());
        open();
    }
    ~StoreTest() override {
        store.reset();
        fs::remove_all(folder);
    }
    void open() {
        store.reset();
        StoreOptions options{folder + "/data"};
        options.now = [this] { return time.load(); };
        store = std::make_unique<Store>(options);
    }
    static std::string runs_of(const std::string& hash) { return "runs of " + hash; }
    void save_part(const std::string& hash, const std::string& key, const std::string& bytes) {
        store->save_checkpoint(hash, runs_of(hash), key, store->objects().put(bytes));
    }
    static NewJob job(const std::string& hash, const std::string& owner = "anna") {
        NewJob job;
        job.process = "brdf";
        job.document = "{\"of\":\"" + hash + "\"}";
        job.job_hash = hash;
        job.runs_hash = runs_of(hash);
        job.owner = owner;
        job.request_hash = "request " + hash;
        return job;
    }
    std::string accept(const std::string& hash, const std::string& owner = "anna") {
        return store->accept(job(hash, owner)).job.id;
    }
    std::string claim() {
        const std::optional<ClaimedJob> claimed = store->next_job();
        return claimed ? claimed->job.id : "";
    }
    void succeed(const std::string& hash, const std::string& content = "table") {
        store->succeed(hash, {{"table.csv", "text/csv", store->objects().put(content)}});
    }
    StoredJob find(const std::string& id) { return store->find(id).value(); }
    JobStatus status(const std::string& id) { return find(id).status; }
    std::vector<std::string> ids(const JobFilter& filter) {
        std::vector<std::string> found;
        for (const StoredJob& stored : store->list(filter)) found.push_back(stored.id);
        return found;
    }

    std::string folder;
    std::atomic<int64_t> time{1000};
    std::unique_ptr<Store> store;
};

// ---- objects

TEST_F(StoreTest, ObjectsAreNamedAfterTheirContent) {
    ObjectWriter writer = store->objects().writer();
    writer.write("ab");
    writer.write("c");
    const StoredObject object = writer.finish();
    EXPECT_EQ(object.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    EXPECT_EQ(object.bytes, 3);
    EXPECT_EQ(store->objects().size(object.sha256), 3);
    EXPECT_EQ(read_file(folder + "/data/objects/ba/" + object.sha256), "abc");
    EXPECT_EQ(read_file(store->objects().path(object.sha256)), "abc");
    EXPECT_EQ(store->objects().put("abc").sha256, object.sha256);
    EXPECT_TRUE(fs::is_empty(folder + "/data/tmp"));
}

TEST_F(StoreTest, AnUnfinishedOrWrongObjectLeavesNothing) {
    {
        ObjectWriter dropped = store->objects().writer();
        dropped.write("dropped");
        ObjectWriter wrong = store->objects().writer();
        wrong.write("abd");
        EXPECT_EQ(code_of([&] { wrong.finish(sha256_hex("abc")); }), ErrorCode::invalid_input);
    }
    EXPECT_TRUE(fs::is_empty(folder + "/data/tmp"));
    EXPECT_FALSE(store->objects().exists(sha256_hex("abd")));
    EXPECT_EQ(store->check(true).objects, 0);
}

TEST_F(StoreTest, OnlyAHashNamesAnObject) {
    for (const std::string& name : {std::string("../../jobs.db"), std::string(), std::string(64, 'A'),
                                    std::string(63, 'a') + "/", sha256_hex("never written")}) {
        EXPECT_FALSE(store->objects().exists(name));
        EXPECT_EQ(code_of([&] { store->objects().open(name); }), ErrorCode::not_found) << name;
    }
}

TEST_F(StoreTest, LeftoversOfADeadWriterGoAtTheStart) {
    std::ofstream(folder + "/data/tmp/77") << "half";
    open();
    EXPECT_TRUE(fs::is_empty(folder + "/data/tmp"));
}

TEST_F(StoreTest, ADamagedObjectIsMendedWhenItComesAgain) {
    const std::string sha256 = store->objects().put("whole").sha256;
    fs::resize_file(store->objects().path(sha256), 2);
    store->objects().put("whole");
    EXPECT_EQ(read_file(store->objects().path(sha256)), "whole");
}

// ---- accepting

TEST_F(StoreTest, AcceptedJobsAreFoundAsTheyCame) {
    NewJob mine = job("h");
    mine.message = "queued";
    const StoredJob stored = find(store->accept(mine).job.id);
    EXPECT_EQ(stored.id.size(), 32u);
    EXPECT_EQ(stored.process, "brdf");
    EXPECT_EQ(stored.job_hash, "h");
    EXPECT_EQ(stored.owner, "anna");
    EXPECT_EQ(stored.status, JobStatus::accepted);
    EXPECT_EQ(stored.message, "queued");
    EXPECT_EQ(stored.created, 1000);
    EXPECT_FALSE(stored.started || stored.finished || stored.expires || stored.problem);
    EXPECT_EQ(store->document(stored.id), mine.document);
    EXPECT_FALSE(store->find("0"));
    EXPECT_FALSE(store->document("0"));
}

TEST_F(StoreTest, OneJobPerOwnerAndKey) {
    NewJob mine = job("h");
    mine.idempotency_key = "k";
    const Acceptance first = store->accept(mine);
    EXPECT_EQ(first.outcome, Acceptance::Outcome::created);
    const Acceptance again = store->accept(mine);
    EXPECT_EQ(again.outcome, Acceptance::Outcome::repeated);
    EXPECT_EQ(again.job.id, first.job.id);

    mine.request_hash = "another";
    const Acceptance conflict = store->accept(mine);
    EXPECT_EQ(conflict.outcome, Acceptance::Outcome::key_conflict);
    EXPECT_EQ(conflict.job.id, first.job.id);

    mine.owner = "berta";
    EXPECT_EQ(store->accept(mine).outcome, Acceptance::Outcome::created);
    EXPECT_NE(accept("h"), accept("h")) << "without a key every request is a job";
    EXPECT_EQ(store->list({}).size(), 4u);
}

TEST_F(StoreTest, EightThreadsGetOneJobEach) {
    std::vector<std::thread> threads;
    std::atomic<int> created{0};
    for (int t = 0; t < 8; ++t)
        threads.emplace_back([&, t] {
            for (int k = 0; k < 50; ++k) {
                NewJob mine = job("h" + std::to_string(k), std::to_string(t / 2));
                mine.idempotency_key = std::to_string(k);  // every key comes from two threads
                created += store->accept(mine).outcome == Acceptance::Outcome::created;
            }
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(created, 200);
    JobFilter all;
    all.limit = 1000;
    const std::vector<std::string> found = ids(all);
    EXPECT_EQ(std::set(found.begin(), found.end()).size(), 200u);
    EXPECT_EQ(store->counts().all.queued, 200);
    EXPECT_EQ(store->counts().by_owner.at("3").queued, 50);
}

TEST_F(StoreTest, AJobNeedsItsSurfaces) {
    NewJob mine = job("h");
    mine.surfaces = {sha256_hex("relief")};
    EXPECT_EQ(code_of([&] { store->accept(mine); }), ErrorCode::not_found);
    EXPECT_TRUE(store->list({}).empty()) << "half a job was stored";
    store->put_surface(store->objects().put("relief"));
    EXPECT_TRUE(store->has_surface(mine.surfaces[0]));
    EXPECT_EQ(store->accept(mine).outcome, Acceptance::Outcome::created);
}

// ---- computing

TEST_F(StoreTest, TheOldestJobIsComputedFirst) {
    const std::string a = accept("a"), b = accept("b");
    time = 2000;
    const ClaimedJob claimed = store->next_job().value();
    EXPECT_EQ(claimed.job.id, a);
    EXPECT_EQ(claimed.document, "{\"of\":\"a\"}");
    EXPECT_EQ(claimed.job.status, JobStatus::running);
    EXPECT_EQ(claimed.job.started, 2000);
    EXPECT_EQ(claimed.job.attempts, 1);
    EXPECT_EQ(claim(), b);
    EXPECT_EQ(claim(), "");
    time = 3000;
    succeed("a");
    EXPECT_EQ(status(a), JobStatus::successful);
    EXPECT_EQ(find(a).progress, 100);
    EXPECT_EQ(find(a).finished, 3000);
    store->fail("b", "no light", "{\"title\":\"no light\"}");
    EXPECT_EQ(status(b), JobStatus::failed);
    EXPECT_EQ(find(b).message, "no light");
    EXPECT_EQ(find(b).problem, "{\"title\":\"no light\"}");
}

TEST_F(StoreTest, EqualJobsShareOneComputation) {
    const std::string leader = accept("h"), follower = accept("h");
    EXPECT_EQ(claim(), leader);
    EXPECT_EQ(claim(), "") << "the same was computed twice";
    EXPECT_EQ(status(follower), JobStatus::accepted);
    succeed("h", "values");
    EXPECT_EQ(status(follower), JobStatus::successful);

    time = 5000;
    const StoredJob late = store->accept(job("h")).job;
    EXPECT_EQ(late.status, JobStatus::successful) << "the result was there";
    EXPECT_EQ(late.finished, 5000);
    const std::vector<ResultOutput> outputs = store->results("h");
    ASSERT_EQ(outputs.size(), 1u);
    EXPECT_EQ(outputs[0].name, "table.csv");
    EXPECT_EQ(outputs[0].media_type, "text/csv");
    EXPECT_EQ(outputs[0].sha256, sha256_hex("values"));
    EXPECT_EQ(outputs[0].bytes, 6);
    EXPECT_EQ(outputs[0].last_used, 5000);

    const std::string first = accept("f"), second = accept("f");
    claim();
    store->fail("f", "no", "{}");
    EXPECT_EQ(status(first), JobStatus::failed);
    EXPECT_EQ(status(second), JobStatus::failed);
    EXPECT_EQ(store->accept(job("f")).job.status, JobStatus::accepted) << "a failure is no result";
}

TEST_F(StoreTest, ProgressIsSeenSoonAndVersionsGrow) {
    const std::string id = accept("h");
    claim();
    const int64_t version = find(id).version;
    uint64_t seen = store->changes();
    for (int percent = 1; percent <= 40; ++percent) store->progress("h", percent, "marching");
    seen = store->wait_for_change(seen, 5s);
    EXPECT_EQ(find(id).progress, 40);
    EXPECT_EQ(find(id).message, "marching");
    EXPECT_EQ(find(id).version, version + 1) << "forty words were not made one";
    EXPECT_EQ(store->wait_for_change(seen, 1ms), seen);
    std::thread other([&] { succeed("h"); });
    EXPECT_NE(store->wait_for_change(seen, 5s), seen);
    other.join();
    EXPECT_GT(find(id).version, version + 1);
}

TEST_F(StoreTest, LookingForAJobInVainIsNoChange) {
    const uint64_t seen = store->changes();
    EXPECT_EQ(claim(), "");
    EXPECT_EQ(store->changes(), seen) << "workers that wait for changes would wake each other for ever";
}

TEST_F(StoreTest, DismissingEndsWhatNobodyElseWants) {
    const std::string queued = accept("q");
    EXPECT_EQ(store->dismiss(queued), Dismissal::dismissed);
    EXPECT_EQ(status(queued), JobStatus::dismissed);
    EXPECT_EQ(store->dismiss(queued), Dismissal::finished);
    EXPECT_EQ(store->dismiss("0"), Dismissal::not_found);
    EXPECT_EQ(claim(), "");

    const std::string running = accept("r");
    claim();
    save_part("r", "part", "part");
    EXPECT_FALSE(store->stop_requested("r"));
    EXPECT_EQ(store->dismiss(running), Dismissal::stopping);
    EXPECT_EQ(store->dismiss(running), Dismissal::stopping);
    EXPECT_TRUE(store->stop_requested("r"));
    EXPECT_EQ(status(running), JobStatus::running);
    store->stopped("r");
    EXPECT_EQ(status(running), JobStatus::dismissed);
}

TEST_F(StoreTest, AnEqualJobTakesADismissedComputationOver) {
    const std::string leader = accept("h"), heir = accept("h");
    claim();
    save_part("h", "part", "part");
    EXPECT_EQ(store->dismiss(leader), Dismissal::dismissed);
    EXPECT_EQ(status(leader), JobStatus::dismissed);
    EXPECT_EQ(status(heir), JobStatus::running);
    EXPECT_FALSE(store->stop_requested("h"));
    EXPECT_EQ(store->checkpoints(runs_of("h")).size(), 1u);
    EXPECT_EQ(claim(), "");
    succeed("h");
    EXPECT_EQ(status(heir), JobStatus::successful);
    EXPECT_EQ(status(leader), JobStatus::dismissed);
}

TEST_F(StoreTest, AComputationThatEndsAfterItsDismissalStaysDismissed) {
    const std::string id = accept("h");
    claim();
    store->dismiss(id);
    const std::string later = accept("h");
    succeed("h");
    EXPECT_EQ(status(id), JobStatus::dismissed);
    EXPECT_EQ(status(later), JobStatus::successful);
}

TEST_F(StoreTest, CheckpointsAreFoundAgain) {
    const std::string id = accept("h");
    claim();
    save_part("h", "2", "old");
    save_part("h", "2", "second");
    save_part("h", "1", "first");
    open();
    EXPECT_EQ(status(id), JobStatus::accepted);
    ASSERT_EQ(store->checkpoints(runs_of("h")).size(), 2u);
    EXPECT_EQ(store->checkpoints(runs_of("h"))[0].key, "1");
    EXPECT_EQ(store->load_checkpoint(runs_of("h"), "2")->sha256, sha256_hex("second"));
    EXPECT_FALSE(store->load_checkpoint(runs_of("h"), "3"));
    EXPECT_EQ(store->gc(0).objects, 1) << "the replaced part, and not those of an unfinished job";
}

// Longer than their job, for a finer one; but they are the first to go, and not while such a job waits.
TEST_F(StoreTest, CheckpointsAreTheFirstToGo) {
    for (const char* hash : {"a", "b"}) {
        accept(hash);
        claim();
        time += 10;
        save_part(hash, "1", std::string(1000, hash[0]));
        succeed(hash, std::string("table of ") + hash);
    }
    EXPECT_EQ(store->gc(3000).bytes_after, 2020);
    NewJob finer = job("finer");
    finer.runs_hash = runs_of("a");
    const std::string id = store->accept(finer).job.id;
    GcReport report = store->gc(1500);
    EXPECT_EQ(report.checkpointed, 1);
    EXPECT_EQ(report.results, 0);
    EXPECT_EQ(store->checkpoints(runs_of("a")).size(), 1u);
    EXPECT_TRUE(store->checkpoints(runs_of("b")).empty());
    EXPECT_EQ(store->dismiss(id), Dismissal::dismissed);
    report = store->gc(20);
    EXPECT_EQ(report.checkpointed, 1);
    EXPECT_EQ(report.bytes_after, 20);
    EXPECT_EQ(report.results, 0);
    EXPECT_TRUE(store->check(true).faults.empty());
}

TEST_F(StoreTest, AnErrorOfTheDiskIsTriedAgain) {
    const std::string id = accept("h");
    for (int attempt = 1; attempt < 20; ++attempt) {
        EXPECT_EQ(claim(), id);
        EXPECT_TRUE(store->try_again("h")) << attempt;
        EXPECT_EQ(status(id), JobStatus::accepted);
    }
    EXPECT_EQ(claim(), id);
    EXPECT_FALSE(store->try_again("h"));
    EXPECT_EQ(status(id), JobStatus::running);
    save_part("h", "1", "progress");
    EXPECT_TRUE(store->try_again("h"));
    EXPECT_EQ(claim(), id);
    EXPECT_EQ(store->dismiss(id), Dismissal::stopping);
    EXPECT_TRUE(store->try_again("h"));
    EXPECT_EQ(status(id), JobStatus::dismissed);
}

TEST_F(StoreTest, AJobThatKillsTheServiceIsGivenUp) {
    const std::string id = accept("h"), equal = accept("h"), other = accept("o");
    for (int attempt = 1; attempt <= 20; ++attempt) {
        // After three deaths the others go first.
        if (attempt == 5) {
            EXPECT_EQ(claim(), other);
            succeed("o");
        }
        EXPECT_EQ(claim(), id);
        EXPECT_EQ(find(id).attempts, attempt);
        open();
    }
    EXPECT_EQ(status(id), JobStatus::failed);
    EXPECT_EQ(status(equal), JobStatus::failed);
    EXPECT_NE(find(id).problem->find("20 attempts"), std::string::npos);
}

TEST_F(StoreTest, AnOrderlyStopIsNoAttempt) {
    const std::string id = accept("h");
    for (int k = 0; k < 7; ++k) {
        EXPECT_EQ(claim(), id);
        store->release("h");
        open();
    }
    EXPECT_EQ(status(id), JobStatus::accepted);
    EXPECT_EQ(find(id).attempts, 0);
    claim();
    store->dismiss(id);
    open();
    EXPECT_EQ(status(id), JobStatus::dismissed);
}

TEST_F(StoreTest, OutputsHaveNamesOfFiles) {
    accept("h");
    claim();
    for (const char* name : {"", "../x", "a/b", ".hidden", "SHA256SUMS", "document.json", "a b"})
        EXPECT_EQ(code_of([&] {
                      store->succeed("h", {{name, "text/csv", store->objects().put("x")}});
                  }),
                  ErrorCode::internal)
            << name;
    EXPECT_TRUE(store->results("h").empty());
}

// ---- looking up

TEST_F(StoreTest, ListsAreFilteredAndPaged) {
    std::vector<std::string> jobs;
    for (int k = 0; k < 6; ++k) {
        time = 1000 * (k + 1);
        jobs.push_back(accept("h" + std::to_string(k), k % 2 ? "berta" : "anna"));
    }
    time = 10000;
    claim();
    claim();
    time = 12500;
    succeed("h0");
    time = 14000;  // h0 took 2.5 s, h1 is 4 s old

    JobFilter filter;
    filter.limit = 4;
    EXPECT_EQ(ids(filter), (std::vector{jobs[5], jobs[4], jobs[3], jobs[2]}));
    filter.after = find(jobs[2]).sequence;
    EXPECT_EQ(ids(filter), (std::vector{jobs[1], jobs[0]}));

    const auto only = [&](auto set) {
        JobFilter one;
        set(one);
        return ids(one);
    };
    EXPECT_EQ(only([](JobFilter& f) {
                  f.statuses = {JobStatus::running, JobStatus::successful};
              }),
              (std::vector{jobs[1], jobs[0]}));
    EXPECT_EQ(only([](JobFilter& f) { f.owner = "berta"; }), (std::vector{jobs[5], jobs[3], jobs[1]}));
    EXPECT_EQ(only([](JobFilter& f) { f.process = "ndf"; }).size(), 0u);
    EXPECT_EQ(only([](JobFilter& f) { f.created_from = 2000, f.created_to = 3000; }),
              (std::vector{jobs[2], jobs[1]}));
    EXPECT_EQ(only([](JobFilter& f) { f.min_duration_ms = 2500; }), (std::vector{jobs[1], jobs[0]}));
    EXPECT_EQ(only([](JobFilter& f) { f.min_duration_ms = 2501; }), (std::vector{jobs[1]}));
    EXPECT_EQ(only([](JobFilter& f) { f.max_duration_ms = 2500; }), (std::vector{jobs[0]}));
    EXPECT_EQ(store->counts().all.queued, 4);
    EXPECT_EQ(store->counts().all.running, 1);
    EXPECT_EQ(store->counts().by_owner.at("berta").running, 1);
    EXPECT_EQ(code_of([] { status_named("done"); }), ErrorCode::invalid_input);
}

// ---- upkeep

TEST_F(StoreTest, TheLeastRecentlyUsedGoesFirst) {
    for (const char* hash : {"a", "b", "c"}) {
        accept(hash);
        claim();
        succeed(hash, std::string(100, *hash));
        time += 1000;
    }
    const std::string a = ids({})[2], b = ids({})[1];
    store->touch_results("a");
    while (store->results("a")[0].last_used != time) std::this_thread::sleep_for(1ms);

    GcReport report = store->gc(300);
    EXPECT_EQ(report.results + report.objects, 0) << "all of it fits";
    time = 9000;
    report = store->gc(250);
    EXPECT_EQ(report.results, 1);
    EXPECT_EQ(report.objects, 1);
    EXPECT_EQ(report.bytes_before, 300);
    EXPECT_EQ(report.bytes_after, 200);
    EXPECT_TRUE(store->results("b").empty());
    EXPECT_EQ(find(b).expires, 9000);
    EXPECT_EQ(status(b), JobStatus::successful);
    EXPECT_FALSE(find(a).expires);
    EXPECT_FALSE(store->objects().exists(sha256_hex(std::string(100, 'b'))));
    EXPECT_TRUE(store->check(true).faults.empty());

    EXPECT_EQ(status(accept("b")), JobStatus::accepted);
    claim();
    succeed("b", std::string(100, 'b'));
    EXPECT_FALSE(find(b).expires) << "its results are back";
}

TEST_F(StoreTest, WhatUnfinishedJobsNeedStays) {
    const std::string relief = store->objects().put("relief").sha256;
    store->put_surface(store->objects().put("relief"));
    store->put_surface(store->objects().put("unused"));
    NewJob mine = job("h");
    mine.surfaces = {relief};
    store->accept(mine);
    EXPECT_EQ(store->gc(0).surfaces, 1);
    EXPECT_TRUE(store->objects().exists(relief));
    claim();
    EXPECT_EQ(store->gc(0).surfaces, 0);
    succeed("h");
    EXPECT_EQ(store->gc(0).surfaces, 1);
    EXPECT_FALSE(store->objects().exists(relief));
    EXPECT_FALSE(store->has_surface(relief));
}

TEST_F(StoreTest, ASharedObjectCountsOnceAndOutlivesOneOfItsRows) {
    for (const char* hash : {"a", "b"}) {
        accept(hash);
        claim();
        succeed(hash, "the same");
        ++time;
    }
    const GcReport report = store->gc(8);
    EXPECT_EQ(report.bytes_before, 8);
    EXPECT_EQ(report.results, 0);
    EXPECT_TRUE(store->objects().exists(sha256_hex("the same")));
}

TEST_F(StoreTest, WhatIsAboutToBeReferredToIsNotRemoved) {
    std::optional<StoredObject> held = store->objects().put("held");
    const std::string sha256 = held->sha256;
    EXPECT_EQ(store->check(false).orphans, 1);
    store->gc(0);
    EXPECT_TRUE(store->objects().exists(sha256));
    held.reset();
    store->gc(0);
    EXPECT_FALSE(store->objects().exists(sha256));
    EXPECT_EQ(code_of([&] { store->objects().pin(sha256); }), ErrorCode::not_found);
}

TEST_F(StoreTest, RemovingAndWritingAtOnceLosesNothing) {
    std::atomic<bool> done{false};
    std::thread collector([&] {
        while (!done) store->gc(int64_t{1} << 40);
    });
    for (int k = 0; k < 200; ++k) save_part("h", "key", std::to_string(k % 3));
    done = true;
    collector.join();
    EXPECT_TRUE(store->check(true).faults.empty());
}

TEST_F(StoreTest, CheckFindsDamage) {
    for (const char* hash : {"missing", "short", "changed"}) {
        accept(hash);
        claim();
        succeed(hash, hash);
    }
    EXPECT_TRUE(store->check(true).faults.empty());
    EXPECT_EQ(store->check(true).rows, 3);
    fs::remove(store->objects().path(sha256_hex("missing")));
    fs::resize_file(store->objects().path(sha256_hex("short")), 1);
    std::ofstream(store->objects().path(sha256_hex("changed"))) << "CHANGED";
    EXPECT_EQ(store->check(false).faults.size(), 2u);
    EXPECT_EQ(store->check(true).faults.size(), 3u);
    Database(folder + "/data/jobs.db", Database::Access::write).execute("DELETE FROM results");
    EXPECT_EQ(store->check(true).faults.size(), 3u) << "successful jobs without results";
}

TEST_F(StoreTest, AnExportCanBeCheckedByOthers) {
    const std::string id = accept("h");
    claim();
    succeed("h", "1,2\n");
    store->export_job(id, folder + "/export");
    EXPECT_EQ(read_file(folder + "/export/document.json"), "{\"of\":\"h\"}");
    EXPECT_EQ(read_file(folder + "/export/table.csv"), "1,2\n");
    EXPECT_EQ(std::system(("cd " + folder + "/export && sha256sum --quiet -c SHA256SUMS").c_str()), 0);
    EXPECT_EQ(code_of([&] { store->export_job("0", folder + "/export"); }), ErrorCode::not_found);
    std::ofstream(store->objects().path(sha256_hex("1,2\n"))) << "9,9\n";
    EXPECT_EQ(code_of([&] { store->export_job(id, folder + "/export"); }), ErrorCode::io);
}

// ---- opening

TEST_F(StoreTest, OneProcessOwnsTheFolder) {
    // A process of its own, since a lock could be one that a process shares with itself.
    const pid_t child = ::fork();
    if (child == 0) {
        try {
            Store second({folder + "/data"});
            ::_exit(0);
        } catch (const Error& error) {
            ::_exit(std::string(error.what()).find("another running process") != std::string::npos ? 7 : 8);
        }
    }
    int ending = 0;
    ::waitpid(child, &ending, 0);
    EXPECT_EQ(WEXITSTATUS(ending), 7);
}

TEST_F(StoreTest, AFileOfANewerGonioIsRefused) {
    store.reset();
    Database(folder + "/data/jobs.db", Database::Access::write).execute("PRAGMA user_version=99");
    EXPECT_EQ(code_of([&] { Store({folder + "/data"}); }), ErrorCode::io);
}

TEST_F(StoreTest, AFolderThatCannotBeMadeIsAnError) {
    EXPECT_EQ(code_of([] { Store({"/dev/null/store"}); }), ErrorCode::io);
    EXPECT_EQ(code_of([] { Store({""}); }), ErrorCode::io);
}

// ---- the writer's groups

class WriterTest : public testing::Test {
  protected:
    WriterTest() {
        std::string name = (fs::temp_directory_path() / "gonio_writer_XXXXXX").string();
        folder = ::mkdtemp(name.data());
        writer = std::make_unique<Writer>(folder + "/jobs.db",
                                          Writer::Hooks{[this](Database&) { ++groups; }, [] {}, 1});
    }
    ~WriterTest() override {
        writer.reset();
        fs::remove_all(folder);
    }
    // Holds the writer until `gate` opens, so that what is queued meanwhile shares a group.
    void hold() {
        std::promise<void> begun;
        held = writer->submit([this, &begun](Database&) {
            begun.set_value();
            gate.get_future().wait();
            return 0;
        });
        begun.get_future().wait();
    }
    static auto insert(const std::string& sha256) {
        return [sha256](Database& database) {
            Statement(database, "INSERT INTO surfaces VALUES(?, 0, 0, 0)", sha256).run();
            return sha256;
        };
    }
    int64_t count() {
        Database database(folder + "/jobs.db", Database::Access::read);
        Statement row(database, "SELECT count(*) FROM surfaces");
        row.step();
        return row.integer(0);
    }
    std::string folder;
    std::atomic<int> groups{0};
    std::promise<void> gate;
    std::future<int> held;
    std::unique_ptr<Writer> writer;
};

TEST_F(WriterTest, AFailingRequestLeavesItsNeighboursAlone) {
    hold();
    std::future<std::string> before = writer->submit(insert("a"));
    std::future<int> half = writer->submit([](Database& database) -> int {
        insert("half")(database);
        throw Error(ErrorCode::invalid_input, "", "", "changed its mind");
    });
    std::future<std::string> twice = writer->submit(insert("a"));
    std::future<std::string> after = writer->submit(insert("b"));
    gate.set_value();
    EXPECT_EQ(before.get(), "a");
    EXPECT_EQ(code_of([&] { half.get(); }), ErrorCode::invalid_input);
    EXPECT_EQ(code_of([&] { twice.get(); }), ErrorCode::io);
    EXPECT_EQ(after.get(), "b");
    EXPECT_EQ(groups, 2) << "they did not share a transaction";
    EXPECT_EQ(count(), 2);
}

TEST_F(WriterTest, ALostTransactionIsTriedAgainOneByOne) {
    hold();
    std::future<std::string> before = writer->submit(insert("a"));
    std::future<int> loser = writer->submit([](Database& database) -> int {
        database.execute("ROLLBACK");  // as SQLite does by itself when the disk is full
        throw Error(ErrorCode::io, "", "", "no room");
    });
    std::future<std::string> after = writer->submit(insert("b"));
    gate.set_value();
    EXPECT_EQ(before.get(), "a");
    EXPECT_EQ(code_of([&] { loser.get(); }), ErrorCode::io);
    EXPECT_EQ(after.get(), "b");
    EXPECT_EQ(count(), 2);
}

TEST_F(WriterTest, WhoWorksAloneSeesOnlyWhatIsDurable) {
    hold();
    std::future<std::string> before = writer->submit(insert("a"));
    std::atomic<int64_t> seen{-1};
    std::thread alone([&] {
        writer->run_alone([&](Database&) {
            seen = count();  // on another connection: only what is committed
            return true;
        });
    });
    std::this_thread::sleep_for(20ms);
    gate.set_value();
    alone.join();
    EXPECT_EQ(seen, 1);
}

TEST_F(WriterTest, ClosingAnswersWhatIsQueued) {
    hold();
    std::future<std::string> queued = writer->submit(insert("a"));
    gate.set_value();
    writer.reset();
    EXPECT_EQ(queued.get(), "a");
}

}  // namespace
}  // namespace gonio
