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

// Directions whose lit slivers no sample met, and which of them is worst, in words.
struct Unresolved {
    int n = 0;
    double share = 0;
    std::string worst;
};
Unresolved unresolved_directions(const MeasuredScene& scene, const Stage& stage) {
    Unresolved found;
    if (stage.settings.tiles_x > 0 || !scene.projected_area_is_known()) return found;
    const auto look = [&](const char* side, const std::vector<AnglesDeg>& directions,
                          const std::vector<double>& ratios) {
        for (size_t d = 0; d < ratios.size(); ++d) {
            const double share = unresolved_share(ratios[d]);
            found.n += share > 0;
            if (share <= found.share) continue;
            found.share = share;
            found.worst = std::string(side) + " theta " + number(directions[d].theta_deg) + ", phi " +
                          number(directions[d].phi_deg) + " degrees";
        }
    };
    look("incident", scene.plan->incident, stage.projected_lights.mean());
    look("outgoing", scene.plan->outgoing, stage.projected_views.mean());
    return found;
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
    if (const Unresolved found = unresolved_directions(scene, last); found.n > 0) {
        report.counters.push_back({"directions whose lit slivers were not resolved", double(found.n)});
        report.warnings.push_back(
            (found.n == 1 ? "1 direction grazes" : std::to_string(found.n) + " directions graze") +
            " the relief so that samples miss what is lit or seen (worst: " + found.worst + ", " +
            number(100 * found.share) + " % of it): the bias column says so; more sub_samples help");
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
