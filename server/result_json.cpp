#include "server/result_json.h"

#include <nlohmann/json.hpp>

#include "server/job_hash.h"
#include "server/measure_kind.h"

namespace gonio {
namespace {

using nlohmann::ordered_json;

// File names may hold any bytes: what is not UTF-8 is replaced, never a reason to fail.
std::string dumped(const ordered_json& j, const JsonStyle& style) {
    ordered_json named = ordered_json::object();
    if (!style.job.empty()) named["job"] = style.job;
    named.update(j);
    return named.dump(style.indent, ' ', false, ordered_json::error_handler_t::replace);
}

template <class Value>
ordered_json object(const std::vector<std::pair<std::string, Value>>& members) {
    ordered_json j = ordered_json::object();
    for (const auto& [key, value] : members) j[key] = value;
    return j;
}

ordered_json to_json(const LoadedSurface& loaded) {
    const SurfaceStatistics& s = loaded.statistics;
    return {{"description", loaded.description},
            {"surface_hash", loaded.hash},
            {"nx", s.nx},
            {"ny", s.ny},
            {"pitch_x_m", s.pitch_x},
            {"pitch_y_m", s.pitch_y},
            {"width_m", s.width},
            {"depth_m", s.depth},
            {"border_x", loaded.surface.border_x},
            {"border_y", loaded.surface.border_y},
            {"sq_m", s.sq},
            {"height_min_m", s.height_min},
            {"height_max_m", s.height_max},
            {"rms_slope_x", s.rms_slope_x},
            {"rms_slope_y", s.rms_slope_y},
            {"max_slope", s.max_slope},
            {"wrap_jump_x", s.wrap_jump_x},
            {"wrap_jump_y", s.wrap_jump_y},
            {"correlation_length_x_m", s.correlation_length_x},
            {"correlation_length_y_m", s.correlation_length_y},
            {"distinct_heights", s.distinct_heights},
            {"invariant_x", s.invariant_x},
            {"invariant_y", s.invariant_y},
            {"notes", loaded.notes},
            {"warnings", loaded.warnings}};
}

ordered_json to_json(const Report& report) {
    return {{"relative_error", report.relative_error},
            {"target_met", report.target_met},
            {"settings", object(report.settings)},
            {"skipped", object(report.skipped)},
            {"counters", object(report.counters)},
            {"seconds", object(report.seconds)},
            {"warnings", report.warnings}};
}

ordered_json to_json(const std::vector<OutputRequest>& outputs) {
    ordered_json list = ordered_json::array();
    for (const OutputRequest& output : outputs)
        list.push_back({{"format", output.format}, {"path", output.path}});
    return list;
}

ordered_json opening(const std::string& status, const LoadedJob& job) {
    return {{"status", status}, {"program", program_version()}, {"job_hash", job.hash}};
}

}  // namespace

std::string surface_json(const LoadedSurface& surface) {
    return dumped(to_json(surface), {});
}

std::string result_json(const LoadedJob& job, const Report& report, const std::vector<OutputRequest>& written,
                        const JsonStyle& style) {
    ordered_json j = opening("done", job);
    j["outputs"] = to_json(written);
    j["report"] = to_json(report);
    j["surface"] = to_json(job.surface);
    return dumped(j, style);
}

std::string planned_json(const LoadedJob& job, const JsonStyle& style) {
    ordered_json j = opening("planned", job);
    j["job"] = ordered_json::parse(canonical_job(job.surface.hash, job.material, job.job.plan,
                                                 job.reference ? &*job.reference : nullptr));
    j["surface"] = to_json(job.surface);
    const Prediction cost = kind_of(job.job.plan).predict(job);
    j["prediction"] = {{"cpu_seconds", cost.cpu_seconds},
                       {"memory_bytes", cost.memory_bytes},
                       {"table_bytes", cost.table_bytes}};
    return dumped(j, style);
}

std::string skipped_json(const LoadedJob& job, const std::vector<OutputRequest>& present,
                         const JsonStyle& style) {
    ordered_json j = opening("skipped", job);
    j["outputs"] = to_json(present);
    return dumped(j, style);
}

std::string failure_json(const Error& error, const JsonStyle& style) {
    return dumped({{"status", "failed"},
                   {"code", code_name(error.code())},
                   {"field", error.field()},
                   {"value", error.value()},
                   {"message", error.what()}},
                  style);
}

}  // namespace gonio
