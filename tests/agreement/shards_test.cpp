// However a measurement is cut, interrupted and put together again: the same bits as in one process.
#include "measure/shards.h"

#include <gtest/gtest.h>

#include <map>
#include <mutex>

#include "agreement/measured.h"
#include "directions/gonio_grid.h"
#include "measure/reference.h"
#include "surface/generate.h"

namespace gonio {
namespace {

class Memory : public Checkpoints {
  public:
    std::optional<std::string> load(const std::string& key) override {
        const std::lock_guard lock(mutex_);
        const auto at = parts.find(key);
        return at == parts.end() ? std::nullopt : std::optional(at->second);
    }
    void save(const std::string& key, const std::string& bytes) override {
        const std::lock_guard lock(mutex_);
        ++saved;
        parts[key] = bytes;
    }
    std::map<std::string, std::string> parts;
    int saved = 0;

  private:
    std::mutex mutex_;
};

using Measure = std::function<BrdfResult(const RunOptions&)>;

// All shards one by one, each from what is kept alone, as processes of a cluster would; then nothing is
// missing.
Table shard_by_shard(const Measure& measure, int* n_shards) {
    Memory memory;
    *n_shards = 0;
    for (;;) {
        RunOptions options;
        options.checkpoints = &memory;
        options.shard_task.kind = ShardTask::Kind::compute_none;
        try {
            return measure(options).table;
        } catch (const MissingShards& missing) {
            EXPECT_FALSE(missing.shards().empty());
            // Backwards, on other numbers of threads, the first one twice.
            std::vector<Shard> order(missing.shards().rbegin(), missing.shards().rend());
            order.push_back(order.back());
            for (const auto& [index, key] : order) {
                options.n_threads = 1 + index % 2;
                options.shard_task = {ShardTask::Kind::compute_one, index};
                EXPECT_THROW(measure(options), ShardDone) << index;
            }
            *n_shards += static_cast<int>(missing.shards().size());
        }
    }
}

void expect_same_bits(const Table& a, const Table& b) {
    EXPECT_EQ(a.f, b.f);
    EXPECT_EQ(a.se, b.se);
    EXPECT_EQ(a.bias, b.bias);
    EXPECT_EQ(a.orders, b.orders);
    EXPECT_EQ(a.provenance, b.provenance);
}

struct Case {
    const char* name;
    HeightField surface;
    Material material;
    BrdfPlan plan;
    int least_shards;
};

std::vector<Case> cases() {
    const std::vector<AnglesDeg> lights = {{10, 0}, {50, 30}, {75, 200}},
                                 views = {{0, 0}, {40, 100}, {70, 300}};
    const HeightField rough = generate_gaussian(48, 48, 1, 4, 0.8, 3),
                      fine = generate_gaussian(48, 48, 1, 1.5, 1.5, 3),
                      wide = generate_gaussian(384, 384, 1, 6, 0.7, 4);
    BrdfPlan stages = plan_for_target(lights, views, 0.003),
             symmetric = plan_for_target(lights, lights, 0.02), apart = plan_for_target(lights, views, 0.02),
             windows = plan_for_target(lights, views, 0.02),
             samples = plan_of(lights, views, Accuracy::Samples{2, 64, 1, 3});
    apart.separate_orders = true;
    return {{"several stages, two grids", fine, gray({0.8}), stages, 7},
            {"lights are views", rough, gray({0.8}), symmetric, 6},
            {"orders apart", rough, gray({0.2, 0.8}), apart, 6},
            {"windows", wide, gray({0.8}), windows, 6},
            {"explicit samples", rough, gray({0.8}), samples, 3}};
}

TEST(Shards, HaveTheBitsOfOneProcess) {
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        const Measure all = [&](const RunOptions& options) {
            return measure_brdf(c.surface, c.material, c.plan, options);
        };
        int n_shards = 0;
        expect_same_bits(shard_by_shard(all, &n_shards), all({}).table);
        EXPECT_GE(n_shards, c.least_shards);
    }
}

TEST(Shards, PathTracerToo) {
    const Case c = cases()[0];
    const Measure all = [&](const RunOptions& options) {
        return measure_reference(c.surface, c.material, c.plan, {2048}, options);
    };
    int n_shards = 0;
    expect_same_bits(shard_by_shard(all, &n_shards), all({}).table);
    EXPECT_EQ(n_shards, 3);
}

// Cancelled in the middle of a stage: what is finished is not done again.
TEST(Shards, ACancelledJobGoesOn) {
    const Case c = cases()[0];
    Memory memory;
    RunOptions options;
    options.checkpoints = &memory;
    std::atomic<bool> cancel{false};
    Monitor monitor;
    monitor.cancel_requested = &cancel;
    monitor.on_progress = [&](const Progress&) { cancel = memory.saved >= 4; };
    EXPECT_THROW(measure_brdf(c.surface, c.material, c.plan, options, monitor), Error);
    const int before = memory.saved;
    EXPECT_EQ(before, 4);
    const BrdfResult resumed = measure_brdf(c.surface, c.material, c.plan, options);
    Memory whole;
    options.checkpoints = &whole;
    expect_same_bits(resumed.table, measure_brdf(c.surface, c.material, c.plan, options).table);
    EXPECT_EQ(memory.saved, whole.saved);  // none twice
}

TEST(Shards, ALaterShardAsksForThoseBeforeIt) {
    const Case c = cases()[0];
    Memory memory;
    RunOptions options;
    options.checkpoints = &memory;
    options.shard_task = {ShardTask::Kind::compute_one, 6};
    try {
        measure_brdf(c.surface, c.material, c.plan, options);
        FAIL();
    } catch (const MissingShards& missing) {
        ASSERT_EQ(missing.shards().size(), 6u);
        for (int k = 0; k < 6; ++k) EXPECT_EQ(missing.shards()[k].index, k);
    }
    EXPECT_EQ(memory.saved, 0);
}

// Memory for the runs is given to each alike: how a job is cut must not show on how many threads it ran.
TEST(Shards, BlocksDoNotDependOnThreads) {
    const HeightField surface = generate_gaussian(96, 96, 1, 5, 0.7, 5);
    BrdfPlan plan = plan_of(equal_projected_hemisphere(100), product_grid({20, 60}, {0, 90, 180, 270}),
                            Accuracy::Samples{1, 32, 1, 3});
    RunOptions options;
    options.max_bytes = 60LL << 20;  // too little for all lights at once
    const Table one = measure_brdf(surface, gray({0.7}), plan, options).table;
    options.n_threads = 2;
    expect_same_bits(one, measure_brdf(surface, gray({0.7}), plan, options).table);
}

// A job takes over what it has in common with one of another target.
TEST(Shards, AFinerTargetTakesTheRunsThatAreThere) {
    Case c = cases()[3];
    auto measured = [&](double target, Memory& memory) {
        c.plan.accuracy.target_relative_error = target;
        RunOptions options;
        options.checkpoints = &memory;
        return measure_brdf(c.surface, c.material, c.plan, options);
    };
    Memory shared, alone;
    measured(0.02, shared);  // other settings: nothing in common
    measured(0.005, shared);
    const int coarse = shared.saved;
    const BrdfResult finer = measured(0.003, shared);
    expect_same_bits(finer.table, measured(0.003, alone).table);
    const int computed = shared.saved - coarse;
    EXPECT_GT(computed, 0);
    EXPECT_GE(alone.saved - computed, 6) << "of " << alone.saved << " parts";
    EXPECT_EQ(finer.report.skipped.back().second,
              "a checkpoint had them, of this job or of one with another target");
}

TEST(Shards, ForeignBytesAreRefused) {
    const Case c = cases()[4];
    Memory memory;
    RunOptions options;
    options.checkpoints = &memory;
    for (const std::string& bytes : {std::string(), std::string("x"), std::string(4096, '\xff')}) {
        measure_brdf(c.surface, c.material, c.plan, options);
        memory.parts.begin()->second = bytes;
        EXPECT_THROW(measure_brdf(c.surface, c.material, c.plan, options), Error);
        memory.parts.clear();
    }
}

}  // namespace
}  // namespace gonio
