// gonio measure SURFACE: a job document from options, then the same way as `gonio run`.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "base/error.h"
#include "clients/cli/commands.h"
#include "clients/cli/execute.h"

namespace gonio {
namespace {

struct MeasureCommand {
    JobFlags flags;
    std::string albedo = "0.5", material, incident, outgoing;
    std::vector<std::string> outputs;
    bool print_job = false;
};

// "0.8", "0.8,0.5,0.3" or an image.
JobEntry albedo_entry(const std::string& text) {
    const bool is_numeric = text.find_first_not_of("0123456789.,eE+- ") == std::string::npos;
    if (!is_numeric) return {"/material/albedo/file", text};
    return {"/material/albedo", text.find(',') == std::string::npos ? text : "[" + text + "]", true};
}

// A JSON object as in the job document, or a file with one.
JobEntry material_entry(const std::string& text) {
    if (text.find_first_not_of(" \t\n") != std::string::npos && text[text.find_first_not_of(" \t\n")] == '{')
        return {"/material", text, true};
    return {"/material", read_text(text), true};
}

// "klems", "hemisphere:64", or a JSON object as in the job document.
JobEntry directions_entry(const std::string& pointer, const std::string& text) {
    const std::string hemisphere = "hemisphere:";
    if (text == "klems") return {pointer + "/klems", "full"};
    if (text.starts_with(hemisphere)) return {pointer + "/hemisphere", text.substr(hemisphere.size()), true};
    return {pointer, text, true};
}

bool any_below(const std::vector<JobEntry>& entries, const std::string& pointer) {
    return std::any_of(entries.begin(), entries.end(),
                       [&](const JobEntry& entry) { return entry.pointer.starts_with(pointer); });
}

// A side of the goniometer: as stated, or the default grid for what is not.
void add_side(std::vector<JobEntry>& entries, const std::string& pointer, const std::string& stated,
              const std::string& theta_deg, const std::string& phi_deg) {
    if (!stated.empty()) {
        if (any_below(entries, pointer)) {
            throw Error(ErrorCode::usage, "--" + pointer.substr(pointer.rfind('/') + 1), stated,
                        "stands instead of its -theta and -phi options: leave those out");
        }
        entries.push_back(directions_entry(pointer, stated));
        return;
    }
    if (!any_below(entries, pointer + "/theta_deg"))
        entries.push_back({pointer + "/theta_deg", theta_deg, true});
    if (!any_below(entries, pointer + "/phi_deg")) entries.push_back({pointer + "/phi_deg", phi_deg, true});
}

std::string default_name(const std::vector<JobEntry>& entries) {
    for (const JobEntry& entry : entries) {
        if (entry.pointer == "/surface/file") return std::filesystem::path(entry.value).stem().string();
        if (entry.pointer == "/surface/generate") return entry.value;
    }
    return "gonio";
}

std::string compose(const MeasureCommand& command) {
    std::vector<JobEntry> entries = command.flags.entries();
    if (command.material.empty()) {
        entries.push_back({"/material/model", "lambertian"});
        entries.push_back(albedo_entry(command.albedo));
    } else {
        entries.push_back(material_entry(command.material));
    }
    entries.push_back({"/measure/kind", "brdf"});
    add_side(entries, "/measure/incident", command.incident, "[0, 15, 30, 45, 60, 75]", "[0]");
    add_side(entries, "/measure/outgoing", command.outgoing, "[0, 10, 20, 30, 40, 50, 60, 70, 80]",
             "[0, 15, 30, 45, 60, 75, 90, 105, 120, 135, 150, 165, 180, 195, 210, 225, 240, 255, 270, 285, "
             "300, 315, 330, 345]");
    for (size_t k = 0; k < command.outputs.size(); ++k) {
        const std::string pointer = "/output/" + std::to_string(k);
        const std::string extension = std::filesystem::path(command.outputs[k]).extension().string();
        entries.push_back({pointer + "/format", extension.empty() ? "" : extension.substr(1)});
        entries.push_back({pointer + "/path", command.outputs[k]});
    }
    if (command.outputs.empty()) {
        entries.push_back({"/output", R"([{"format": "csv"}])", true});
        entries.push_back({"/output/0/path", default_name(entries) + ".csv"});
    }
    return compose_job(entries);
}

void add_measure_flags(CLI::App& command, JobFlags& flags) {
    using enum JobFlagKind;
    const std::string directions = "Directions (degrees)",
                      accuracy = "Accuracy (default: relative error 0.01)";
    flags.add(
        command,
        {
            {"--incident-theta", "/measure/incident/theta_deg", list, "Default 0,15,30,45,60,75", directions},
            {"--incident-phi", "/measure/incident/phi_deg", list, "Default 0", directions},
            {"--outgoing-theta", "/measure/outgoing/theta_deg", list, "Default 0,10,...,80", directions},
            {"--outgoing-phi", "/measure/outgoing/phi_deg", list, "Default 0,15,...,345", directions},
            {"--max-order", "/measure/max_order", json, "Only the first orders of scattering (default: all)",
             directions},
            {"--orders", "/measure/orders", text, "sum or separate", directions},
            {"--target-error", "/accuracy/target_relative_error", json, "Relative error, rms over the table",
             accuracy},
            {"--max-seconds", "/accuracy/max_seconds", json, "Stop after so long, with the error reached",
             accuracy},
            {"--sub-samples", "/accuracy/samples/sub_samples", json, "Explicit effort: points per facet",
             accuracy},
            {"--directions", "/accuracy/samples/directions", json, "Shared directions of the indirect term",
             accuracy},
            {"--refinement", "/accuracy/samples/refinement", json,
             "Parts of a facet along its side: 1, 2 or 4", accuracy},
            {"--replicates", "/accuracy/samples/replicates", json, "Independent randomisations", accuracy},
            {"--seed", "/accuracy/seed", json, "Of the random numbers", accuracy},
        });
}

void name_other_flags(JobFlags& flags) {
    flags.name("/material/albedo", "--albedo");
    flags.name("/measure/incident", "--incident");
    flags.name("/measure/outgoing", "--outgoing");
    flags.name("/output", "--output");
    flags.name("/surface", "SURFACE");
}

}  // namespace

void add_measure(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* sub = app.add_subcommand("measure", "Measure the BRDF of a surface, described by options");
    sub->footer(
        "  gonio measure lava.png --width 50mm --height-range 5mm --albedo 0.8 --target-error 0.003 -o "
        "lava.csv\n"
        "  gonio measure scan.gsf --level plane --boundary open -o scan.csv -o scan.exr\n"
        "  gonio measure --generate v_groove --samples 128 --period 2mm --slope-deg 45 --albedo 0.8,0.5,0.3\n"
        "  gonio measure lava.png --width 50mm --height-range 5mm "
        "--material '{\"model\": \"ggx\", \"alpha\": 0.3, \"metal\": \"Cu\"}'\n"
        "  gonio measure lava.png --width 50mm --height-range 5mm --incident klems --outgoing klems\n"
        "  gonio measure lava.png --width 50mm --height-range 5mm --print-job > lava.json   # then: gonio "
        "run lava.json");
    const auto command = std::make_shared<MeasureCommand>();
    add_surface_flags(*sub, command->flags);
    CLI::Option* albedo =
        sub->add_option("--albedo", command->albedo, "0.8, or R,G,B, or an image of the surface's size");
    albedo->capture_default_str();
    sub->add_option("--material", command->material,
                    "Other facets than Lambertian: JSON as in the job document, or a file with it")
        ->excludes(albedo);
    sub->add_option("--incident", command->incident, "klems, hemisphere:N or JSON, instead of a grid")
        ->group("Directions (degrees)");
    sub->add_option("--outgoing", command->outgoing, "The same for the viewing side")
        ->group("Directions (degrees)");
    add_measure_flags(*sub, command->flags);
    name_other_flags(command->flags);
    sub->add_option("-o,--output", command->outputs, "Table to write: .csv, .json or .exr; may be repeated")
        ->take_all();
    sub->add_flag("--print-job", command->print_job, "Print the job document and run nothing");
    add_run_options(*sub, common);
    sub->callback([command, &common, &action] {
        action = [command, &common] {
            return with_flag_names(command->flags, [&] {
                const std::string document = compose(*command);
                if (command->print_job) {
                    std::cout << document << std::endl;
                    return 0;
                }
                return execute_job(parse_job(document, {}), common);
            });
        };
    });
}

}  // namespace gonio
