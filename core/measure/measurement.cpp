#include "measure/measurement.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include "base/parallel.h"
#include "measure/base_doubt.h"
#include "measure/describe.h"
#include "measure/shard_bytes.h"

namespace gonio {
namespace {

constexpr int most_stages = 12;

// Everything that one measurement carries from stage to stage.
class Measurement {
  public:
    Measurement(const MeasuredScene& scene, Transport& transport, const RunOptions& options,
                const Monitor& monitor, BrdfResult& result)
        : scene_(scene),
          accuracy_(scene.plan->accuracy),
          transport_(transport),
          options_(options),
          shards_(options.checkpoints, options.shard_task),
          monitor_(monitor),
          result_(result),
          started_(std::chrono::steady_clock::now()),
          side_{[this](const Stage& stage, const std::string& part,
                       const std::function<std::string()>& compute) {
                    return shards_.part(part_key(stage, part), compute);
                },
                options.n_threads, monitor} {}

    void run();

  private:
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
    }
    // Of a part of the stage, for every job that comes to the same stage by the same settings.
    std::string part_key(const Stage& stage, const std::string& part) const {
        return "stage" + std::to_string(stage.number) + "-" + part + "-" +
               transport_.settings_key(stage.settings);
    }
    void run_stage(Stage& stage, int n_runs);
    void add_runs(const std::vector<RunValues>& runs, Stage& stage);
    bool ends_in_time(const Stage& stage, NextStep& step) const;
    void write_table(const Estimate& e);

    const MeasuredScene& scene_;
    const Accuracy& accuracy_;
    Transport& transport_;
    RunOptions options_;
    Shards shards_;
    const Monitor& monitor_;
    BrdfResult& result_;
    std::chrono::steady_clock::time_point started_;
    SideWork side_;
    double seconds_per_run_ = 0;
    RunValues totals_;  // counters of all runs
    int runs_found_ = 0;
    std::mutex mutex_;
};

void Measurement::run_stage(Stage& stage, int n_runs) {
    // What is decided from memory must not depend on the number of threads: a run gets the same share on any
    // machine, and memory limits how many go side by side.
    const double bytes =
        std::min(transport_.wanted_bytes(stage.settings), static_cast<double>(options_.max_bytes));
    const int room = std::max(1, static_cast<int>(0.8 * static_cast<double>(options_.max_bytes) / bytes));
    const int outer = std::min({options_.n_threads, n_runs, room});
    const int first = stage.f.count();
    transport_.begin_stage(stage, n_runs);
    std::vector<RunValues> runs(n_runs);
    int done = 0;
    const double began = seconds();
    auto run = [&](const Shards::Batch& batch, int offset, int position, int n_threads) {
        RunValues& values = runs[offset + position];
        values = transport_.run(stage.settings, stage.number, first + offset + position, n_threads, monitor_);
        if (shards_.are_kept()) shards_.save(batch, position, to_bytes(values));
        const std::lock_guard lock(mutex_);
        ++done;
        monitor_.report({static_cast<double>(done) / n_runs,
                         "runs of stage " + std::to_string(stage.number + 1), result_.report.relative_error});
    };
    auto run_batch = [&](int offset, int n) {
        std::vector<std::string> keys;
        for (int k = 0; k < n; ++k)
            keys.push_back(part_key(stage, "run" + std::to_string(first + offset + k)));
        const Shards::Batch batch = shards_.take(std::move(keys));
        for (int k = 0; k < n; ++k)
            if (batch.saved[k]) runs[offset + k] = run_values_from(*batch.saved[k]);
        const int n_new = static_cast<int>(batch.to_compute.size()), side_by_side = std::min(outer, n_new);
        done += n - n_new;
        runs_found_ += n - n_new;
        parallel_for(n_new, outer, [&](int k) {
            run(batch, offset, batch.to_compute[k], std::max(1, options_.n_threads / side_by_side));
        });
        shards_.finish(batch);
    };
    int alone = 0;
    // The first run tells how many orders all of them keep.
    if (scene_.plan->separate_orders && scene_.plan->max_order == 0 && first == 0 && stage.number == 0) {
        run_batch(alone++, 1);
        transport_.fix_orders(runs[0]);
    }
    run_batch(alone, n_runs - alone);
    seconds_per_run_ = (seconds() - began) / n_runs * outer;
    transport_.end_stage(stage, runs, side_);
    add_runs(runs, stage);
}

void Measurement::add_runs(const std::vector<RunValues>& runs, Stage& stage) {
    for (const RunValues& r : runs) {
        stage.f.add(r.f);
        stage.direct.add(r.direct);
        stage.projected_lights.add(r.projected_lights);
        stage.projected_views.add(r.projected_views);
        stage.remainder = std::max(stage.remainder, r.remainder);
        stage.ratio = std::max(stage.ratio, r.ratio);
        totals_.turn = std::max(totals_.turn, r.turn);
        totals_.rays += r.rays;
        totals_.rays_skipped += r.rays_skipped;
        totals_.links += r.links;
        totals_.substituted += r.substituted;
        totals_.dropped += r.dropped;
        totals_.truncated_bundles += r.truncated_bundles;
        totals_.seconds_direct += r.seconds_direct;
        totals_.seconds_links += r.seconds_links;
        totals_.seconds_series += r.seconds_series;
        totals_.applications = std::max(totals_.applications, r.applications);
        totals_.heaviest = std::max(totals_.heaviest, r.heaviest);
    }
}

// Whether the step ends before max_seconds; a step that would not is made smaller if that helps.
bool Measurement::ends_in_time(const Stage& stage, NextStep& step) const {
    if (!accuracy_.max_seconds) return true;
    const double left = *accuracy_.max_seconds - seconds();
    auto wall = [&](int runs, double cost) {
        return cost * seconds_per_run_ * std::ceil(static_cast<double>(runs) / options_.n_threads);
    };
    if (step.more_runs > 0) {
        if (wall(step.more_runs, 1) <= left) return true;
    } else if (wall(runs_at_first, transport_.relative_cost(step.settings, stage.settings)) <= left) {
        return true;
    }
    step.more_runs = 2;
    return stage.f.count() < most_window_runs && wall(2, 1) <= left;
}

void Measurement::run() {
    const std::optional<Accuracy::Samples>& samples = accuracy_.samples;
    const double doubt = base_doubt(scene_), target = accuracy_.target(),
                 // Of the runs, which cannot mend what the base leaves in doubt.
        wanted =
            doubt > 0 ? std::sqrt(std::max(target * target - doubt * doubt, 0.25 * target * target)) : target;
    std::vector<Stage> stages(1);
    stages[0].settings = samples ? transport_.settings_of(*samples)
                                 : transport_.first_settings(wanted > 0 ? wanted : Accuracy::default_target);
    if (const double least = transport_.least_bytes(stages[0].settings);
        least > static_cast<double>(options_.max_bytes))
        throw Error(ErrorCode::limit, "/surface",
                    std::to_string(scene_.surface->nx) + " x " + std::to_string(scene_.surface->ny),
                    "needs " + number(least / 1e6) + " MB of the " +
                        number(static_cast<double>(options_.max_bytes) / 1e6) + " MB allowed");
    run_stage(stages[0], samples ? std::max(2, samples->replicates) : runs_at_first);
    Report& report = result_.report;
    transport_.find_bias(stages, side_, report);

    Estimate e = transport_.estimate(stages);
    while (!samples && (wanted == 0 || e.total > wanted) && static_cast<int>(stages.size()) < most_stages) {
        report.relative_error = e.total;
        NextStep step = transport_.next_step(stages.back(), e, wanted > 0 ? wanted : 0.5 * e.total);
        if (!step.possible || !ends_in_time(stages.back(), step)) break;
        if (step.more_runs > 0) {
            run_stage(stages.back(), step.more_runs);
        } else {
            const RunSettings now = stages.back().settings;
            const bool finer = step.settings.refinement != now.refinement;
            Stage next;
            next.settings = step.settings;
            next.number = static_cast<int>(stages.size());
            if (next.settings.tiles_x > 0 && next.settings.directions == now.directions && !finer)
                next.noise = stages.back().noise;
            stages.push_back(std::move(next));
            run_stage(stages.back(), runs_at_first);
            if (finer) transport_.find_bias(stages, side_, report);
        }
        e = transport_.estimate(stages);
    }

    add_base_doubt(scene_, e);
    write_table(e);
    report.relative_error = e.total;
    report.target_met = target == 0 || e.total <= target;
    transport_.describe(stages, totals_, report);
    if (doubt > 0) report.settings.push_back({"base_doubt", number(100 * doubt) + " % (rms), in the biases"});
    if (runs_found_ > 0)
        report.skipped.push_back({std::to_string(runs_found_) + " runs",
                                  "a checkpoint had them, of this job or of one with another target"});
    report.seconds.emplace_back("wall", seconds());
    if (!report.target_met)
        report.warnings.push_back("target_relative_error " + number(target) +
                                  " was not reached: " + number(e.total));
}

void Measurement::write_table(const Estimate& e) {
    Table& table = result_.table;
    const size_t n = e.f.size();
    table.orders = static_cast<int>(n / (table.channels.size() * table.rows())) - 1;
    table.f.resize(n);
    table.se.resize(n);
    table.bias.resize(n);
    for (size_t i = 0; i < n; ++i) {
        if (!std::isfinite(e.f[i]) || !std::isfinite(e.se[i]) || !std::isfinite(e.bias[i]))
            throw Error(
                ErrorCode::internal, "/measure", "",
                "value " + std::to_string(i) + " is not finite: a defect of gonio, please report the job");
        table.f[i] = static_cast<float>(std::max(0.0, e.f[i]));
        table.se[i] = static_cast<float>(e.se[i]);
        table.bias[i] = static_cast<float>(e.bias[i]);
    }
}

}  // namespace

void measure_by_runs(const MeasuredScene& scene, Transport& transport, const RunOptions& options,
                     const Monitor& monitor, BrdfResult& result) {
    Measurement(scene, transport, options, monitor, result).run();
}

}  // namespace gonio
