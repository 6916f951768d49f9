#include "measure/describe.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "measure/windows.h"
#include "visibility/march.h"

namespace gonio {
namespace {

std::string windows(const RunSettings& settings) {
    if (settings.tiles_x == 0) return "whole period";
    const std::string side = std::to_string(tile_core);
    return std::to_string(settings.tiles_x * settings.tiles_y) + " a run of " + side + " x " + side +
           " cells";
}

std::string mesh_bias_in_words(const MeshBias& mesh_bias) {
    if (!mesh_bias.measured()) return "guessed from the relief";
    return "two grids: second order corrected by " + number(100 * mesh_bias.share_of_order(2).correction) +
           " %";
}

double noise_correction_percent(const RunContext& context, const Stage& stage) {
    const Parameter& albedo = context.lambertian->albedo;
    const double largest = albedo.is_map() ? 1.0 : albedo.range().second;
    return stage.noise ? -100 * stage.noise->kappa * std::pow(largest, 2) : 0.0;
}

int unresolved_directions(const MeasuredScene& context, const Stage& stage) {
    if (stage.settings.tiles_x > 0 || !context.projected_area_is_known()) return 0;
    int n = 0;
    for (const Moments* projected : {&stage.projected_lights, &stage.projected_views})
        for (const double ratio : projected->mean()) n += unresolved_share(ratio) > 0;
    return n;
}

}  // namespace

std::string number(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", x);
    return text;
}

void describe_settings(const std::vector<Stage>& stages, Report& report) {
    const Stage& last = stages.back();
    int runs = 0;
    for (const Stage& s : stages) runs += s.f.count();
    auto say = [&](const char* key, std::string value) {
        report.settings.push_back({key, std::move(value)});
    };
    say("simd", simd_target());
    say("sub_samples", std::to_string(last.settings.sub_samples));
    say("directions", std::to_string(last.settings.directions));
    say("refinement", std::to_string(last.settings.refinement));
    say("windows", windows(last.settings));
    say("runs", std::to_string(last.f.count()) + " (" + std::to_string(runs) + " in " +
                    std::to_string(stages.size()) + " stages)");
}

void describe_skips(const MeasuredScene& scene, const Stage& last, const RunValues& totals, Report& report) {
    if (totals.rays_skipped > 0)
        report.skipped.push_back({"shadow tests of steep directions", "they are steeper than every facet"});
    if (last.settings.tiles_x > 0)
        report.skipped.push_back({"most receivers", "windows of the surface reach the error asked for"});
    if (const int n = unresolved_directions(scene, last); n > 0) {
        report.counters.push_back({"directions whose lit slivers were not resolved", static_cast<double>(n)});
        report.warnings.push_back(std::to_string(n) +
                                  " directions graze the relief so that samples miss what they light: their "
                                  "bias column says so; more sub_samples help");
    }
}

void describe_turn(const RunValues& totals, Report& report) {
    if (totals.turn > 0)
        report.settings.emplace_back(
            "turn", "frames turn by " + number(degrees(totals.turn)) + " degrees (rms) from facet to facet");
}

void describe_runs(const RunContext& context, const std::vector<Stage>& stages, const MeshBias& mesh_bias,
                   const RunValues& totals, Report& report) {
    const Stage& last = stages.back();
    describe_settings(stages, report);
    auto say = [&](const char* key, std::string value) {
        report.settings.push_back({key, std::move(value)});
    };
    say("applications", std::to_string(totals.applications));
    say("mesh_bias", mesh_bias_in_words(mesh_bias));
    say("noise_bias",
        "corrected by " + number(noise_correction_percent(context, last)) + " % of the direct part");
    say("relative_error", number(report.relative_error));
    report.counters = {{"rays", totals.rays},
                       {"rays skipped (steeper than the relief)", totals.rays_skipped},
                       {"links", totals.links},
                       {"links substituted at window borders", totals.substituted},
                       {"links dropped at window borders", totals.dropped},
                       {"nearly horizontal bundles given up", static_cast<double>(totals.truncated_bundles)}};
    describe_turn(totals, report);
    report.seconds = {{"visibility and direct light", totals.seconds_direct},
                      {"operator", totals.seconds_links},
                      {"orders of scattering", totals.seconds_series}};
    describe_skips(context, last, totals, report);
}

}  // namespace gonio
