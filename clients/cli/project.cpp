// gonio project TABLE
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "base/error.h"
#include "base/text.h"
#include "clients/cli/commands.h"
#include "clients/plot/plot.h"
#include "server/projection_file.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

struct ProjectCommand {
    std::string table, basis = "hsh", form = "per_light", weighting = "cosine";
    int order = 8;
    bool anisotropic = false;
    std::vector<std::string> outputs, plots;
};

ProjectionPlan plan_of(const ProjectCommand& command, const Table& table) {
    ProjectionPlan plan;
    plan.basis = command.basis == "sh" ? ProjectionPlan::Basis::sh : ProjectionPlan::Basis::hsh;
    plan.form = command.form == "per_light" ? ProjectionPlan::Form::per_light
                : command.form == "matrix"  ? ProjectionPlan::Form::matrix
                                            : ProjectionPlan::Form::joint;
    plan.weighting =
        command.weighting == "none" ? ProjectionPlan::Weighting::none : ProjectionPlan::Weighting::cosine;
    plan.order = command.order;
    plan.isotropic = !command.anisotropic;
    plan.samples =
        static_cast<int>(plan.form == ProjectionPlan::Form::joint ? table.rows() : table.outgoing.size());
    return plan;
}

int run_project(const ProjectCommand& command, const CommonOptions& common) {
    const Table table = read_table(command.table);
    const HarmonicProjection projection = project(table, plan_of(command, table));
    if (!common.quiet) {
        const auto& errors = projection.relative_error;
        std::cerr << describe(projection.plan) << ": relative error "
                  << number_text(*std::max_element(errors.begin(), errors.end()), 3) << ", condition number "
                  << number_text(projection.condition_number, 3) << std::endl;
    }
    std::vector<std::string> paths = command.outputs;
    if (paths.empty())
        paths.push_back(std::filesystem::path(command.table).stem().string() + ".projection.json");
    for (const std::string& path : paths) {
        const std::string extension = std::filesystem::path(path).extension().string();
        write_projection(projection, extension.empty() ? "" : extension.substr(1), path);
        if (!common.quiet) std::cerr << "wrote " << path << std::endl;
    }
    for (const std::string& path : command.plots) {
        plot_projection(table, projection, path);
        if (!common.quiet) std::cerr << "wrote " << path << std::endl;
    }
    return 0;
}

}  // namespace

void add_project(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* sub = app.add_subcommand(
        "project", "Project a table to spherical harmonics, its directions being the samples");
    sub->footer(
        "  gonio project lava.csv -o lava.projection.json\n"
        "  gonio project lava.json --basis sh --order 4 -o lava.projection.npy\n"
        "  gonio project lava.csv --plot lobes.svg       measured and reconstructed lobes\n"
        "  gonio project random_pairs.csv --form joint -o lava.projection.csv\n"
        "A job whose \"measure\" has \"project\" measures where it serves best: server/README.md.");
    const auto command = std::make_shared<ProjectCommand>();
    sub->add_option("TABLE", command->table, "Table that gonio wrote: CSV or JSON")->required();
    sub->add_option("--basis", command->basis, "sh, or hsh: hemispherical harmonics")
        ->check(CLI::IsMember({"sh", "hsh"}))
        ->capture_default_str();
    sub->add_option("--order", command->order, "Bands 0 to order - 1: order^2 coefficients a direction")
        ->capture_default_str();
    sub->add_option("--form", command->form,
                    "per_light, matrix (light x view) or joint (reciprocal and isotropic)")
        ->check(CLI::IsMember({"per_light", "matrix", "joint"}))
        ->capture_default_str();
    sub->add_option("--weighting", command->weighting, "cosine: f cos_i cos_o; none: f")
        ->check(CLI::IsMember({"cosine", "none"}))
        ->capture_default_str();
    sub->add_flag("--anisotropic", command->anisotropic, "A joint fit that is reciprocal only");
    sub->add_option("-o,--output", command->outputs,
                    "File to write: .csv, .json or .npy; may be repeated (default: TABLE's name with "
                    ".projection.json)")
        ->take_all();
    sub->add_option("--plot", command->plots, "Picture of measured and reconstructed lobes: .svg or .png")
        ->take_all();
    sub->add_flag("-q,--quiet", common.quiet, "Print nothing but errors on stderr");
    sub->callback([command, &common, &action] {
        action = [command, &common] { return run_project(*command, common); };
    });
}

}  // namespace gonio
