#include "clients/cli/options.h"

#include <CLI/CLI.hpp>
#include <thread>

#include "base/error.h"

namespace gonio {

RunOptions CommonOptions::run_options() const {
    return {threads, !no_skip, static_cast<long long>(max_memory_gib * 0x1p30)};
}

void add_output_options(CLI::App& command, CommonOptions& common) {
    command.add_flag("-q,--quiet", common.quiet, "Print nothing but errors on stderr");
    command.add_flag("--json", common.json, "Print the result as JSON on stdout");
}

void add_run_options(CLI::App& command, CommonOptions& common) {
    add_output_options(command, common);
    common.threads = std::max(1u, std::thread::hardware_concurrency());
    command.add_option("--threads", common.threads, "Threads; the result has the same bits for any number")
        ->check(CLI::Range(1, 1024))
        ->default_str("all");  // not this machine's number: manual pages are for any machine
    command
        .add_option("--max-memory", common.max_memory_gib,
                    "Working memory in GiB; a job that cannot keep it is refused")
        ->check(CLI::Range(0.01, 1e6))
        ->capture_default_str();
    command.add_option("--checkpoints", common.checkpoints,
                       "Folder that keeps what is finished: the job goes on from there after a stop");
    command.add_flag("--no-skip", common.no_skip, "Do the work that the report would say was skipped");
    command.add_flag("--dry-run", common.dry_run,
                     "Read and check everything, print what would run, run nothing");
}

void JobFlags::add(CLI::App& command, const std::vector<JobFlag>& flags) {
    for (const JobFlag& flag : flags) {
        Value& value = values_.emplace_back(Value{flag, "", nullptr});
        value.option = flag.kind == JobFlagKind::present
                           ? command.add_flag(flag.flag, flag.help)
                           : command.add_option(flag.flag, value.text, flag.help);
        if (!flag.group.empty()) value.option->group(flag.group);
    }
}

std::vector<JobEntry> JobFlags::entries() const {
    std::vector<JobEntry> entries;
    for (const Value& value : values_) {
        if (value.option->count() == 0) continue;
        const std::string& pointer = value.flag.pointer;
        switch (value.flag.kind) {
            case JobFlagKind::text:
                entries.push_back({pointer, value.text});
                break;
            case JobFlagKind::json:
                entries.push_back({pointer, value.text, true});
                break;
            case JobFlagKind::list:
                entries.push_back({pointer, "[" + value.text + "]", true});
                break;
            case JobFlagKind::present:
                entries.push_back({pointer, "true", true});
                break;
        }
    }
    return entries;
}

std::string JobFlags::flag_for(const std::string& pointer) const {
    // Elements of a list belong to its flag: "/measure/incident/theta_deg/2".
    const auto is_part_of = [&](const std::string& whole) {
        return pointer == whole || pointer.starts_with(whole + "/");
    };
    for (const Value& value : values_) {
        if (is_part_of(value.flag.pointer)) return value.flag.flag;
    }
    for (const auto& [whole, flag] : names_) {
        if (is_part_of(whole)) return flag;
    }
    return pointer;
}

int with_flag_names(const JobFlags& flags, const std::function<int()>& action) {
    try {
        return action();
    } catch (const Error& error) {
        throw Error(error.code(), flags.flag_for(error.field()), error.value(), error.allowed(),
                    error.where());
    }
}

void add_surface_flags(CLI::App& command, JobFlags& flags) {
    using enum JobFlagKind;
    const std::string size =
        "Size of a measured surface (what its file does not carry is needed; lengths with units)";
    const std::string treatment = "Treatment of a measured surface";
    const std::string made = "Generated surface";
    flags.add(
        command,
        {
            {"SURFACE", "/surface/file", text, "Height field: GSF, PNG, OpenEXR, text matrix, .npy or PFM",
             ""},
            {"--width", "/surface/width", text, "Extent in x of the whole stored grid, such as 50mm", size},
            {"--depth", "/surface/depth", text, "Extent in y (default: square pitch)", size},
            {"--pitch", "/surface/pitch", text, "Distance of neighbouring points in x and y", size},
            {"--pitch-x", "/surface/pitch_x", text, "The same in x", size},
            {"--pitch-y", "/surface/pitch_y", text, "The same in y", size},
            {"--height-range", "/surface/height_range", text,
             "Height of the largest stored integer above 0 (floats: of the highest above the lowest)", size},
            {"--height-scale", "/surface/height_scale", text, "Height of one stored unit", size},
            {"--height-offset", "/surface/height_offset", text, "Added to every height", treatment},
            {"--invert", "/surface/invert", present, "The file is a depth map: large is deep", treatment},
            {"--y-axis", "/surface/y_axis", text, "up: stored row 0 lies at y = 0; down: at the top",
             treatment},
            {"--crop", "/surface/crop", list, "X,Y,WIDTH,HEIGHT in stored columns and rows", treatment},
            {"--resample", "/surface/resample", list, "COLUMNS,ROWS", treatment},
            {"--level", "/surface/level", text, "none, mean, plane or quadratic", treatment},
            {"--boundary", "/surface/boundary", text, "periodic, mirror or open", treatment},
            {"--missing", "/surface/missing", text, "reject or interpolate missing points", treatment},
            {"--generate", "/surface/generate", text,
             "Instead of SURFACE: plane, v_groove, rectangular_groove, sinusoid, egg_crate, spherical_pits "
             "or gaussian",
             made},
            {"--samples", "/surface/samples", json, "Points along x", made},
            {"--samples-y", "/surface/samples_y", json, "Points along y (gaussian)", made},
            {"--period", "/surface/period", text, "Length of one period", made},
            {"--slope-deg", "/surface/slope_deg", json, "Slope of a V-groove's sides", made},
            {"--groove-width", "/surface/groove_width", text, "Width of a rectangular groove", made},
            {"--groove-depth", "/surface/groove_depth", text, "Its depth", made},
            {"--amplitude", "/surface/amplitude", text, "Of a sinusoid or an egg crate", made},
            {"--radius", "/surface/radius", text, "Of a spherical pit", made},
            {"--eta-deg", "/surface/eta_deg", json, "Half opening angle of a pit", made},
            {"--correlation-length", "/surface/correlation_length", text, "Of a Gaussian field", made},
            {"--rms-slope", "/surface/rms_slope", json, "Of a Gaussian field: rms of |grad h|", made},
            {"--surface-seed", "/surface/seed", json, "Of a Gaussian field", made},
        });
}

}  // namespace gonio
