#include "server/projection_file.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/text.h"
#include "directions/spherical_harmonics.h"
#include "fitting/joint_basis.h"
#include "server/canonical.h"
#include "server/npy_file.h"
#include "table/io/formats.h"
#include "table/io/image_io.h"

namespace gonio {
namespace {

using nlohmann::ordered_json;
using Form = ProjectionPlan::Form;

constexpr int format_version = 1;

bool is_sh(const ProjectionPlan& plan) {
    return plan.basis == ProjectionPlan::Basis::sh;
}
bool is_cosine(const ProjectionPlan& plan) {
    return plan.weighting == ProjectionPlan::Weighting::cosine;
}

std::vector<std::string> conventions(const ProjectionPlan& plan) {
    std::vector<std::string> lines{
        std::string("g = ") + (is_cosine(plan) ? "f cos(theta_i) cos(theta_o)" : "f") +
            " in 1/sr, zero below the horizon; f: BRDF; wi points to the light, wo to the viewer, both away "
            "from the surface",
        "angles: degrees; theta from the normal +z, phi from +x (along columns) towards +y (along rows)",
        "y_lm: real spherical harmonics, orthonormal, no Condon-Shortley phase: y_lm = sqrt2 K P_l^|m|(cos "
        "theta) cos(m phi) for m > 0, "
        "sin(|m| phi) for m < 0, y_l0 = K P_l(cos theta); order n: bands l = 0..n-1",
    };
    if (!is_sh(plan))
        lines.emplace_back(
            "hsh: hemispherical harmonics, sqrt2 y_lm with 2 cos(theta) - 1 in place of cos(theta): "
            "orthonormal over the upper hemisphere");
    lines.emplace_back(
        plan.form == Form::per_light ? "g(wo) = sum_lm c_lm y_lm(wo) for each incident direction"
        : plan.form == Form::matrix  ? "g(wi, wo) = sum c y_(l_i, m_i)(wi) y_(l_o, m_o)(wo)"
        : plan.isotropic ? "g(wi, wo) = sum c F, F: y_(l_i, m)(wi) y_(l_o, m)(wo) + y_(l_i, -m)(wi) y_(l_o, "
                           "-m)(wo) and, if l_i != l_o, the same with "
                           "wi and wo exchanged; equal terms once, divided by the root of their number"
                         : "g(wi, wo) = sum c F, F: y_(l_i, m_i)(wi) y_(l_o, m_o)(wo) and, if that is "
                           "another one, the same with wi and wo "
                           "exchanged, then divided by sqrt2");
    lines.emplace_back(
        "se: standard errors of the values carried over as if independent; bias: bound by absolute shares; "
        "relative_error: rms error of "
        "the reconstructed g over rms g, of samples each held out in turn");
    return lines;
}

// The names of coefficient k of a set.
struct CoefficientNames {
    std::vector<std::string> columns;
    std::vector<std::vector<int>> rows;
};
CoefficientNames names_of(const ProjectionPlan& plan) {
    CoefficientNames names;
    std::vector<std::pair<int, int>> bands;
    for (int l = 0; l < plan.order; ++l)
        for (int m = -l; m <= l; ++m) bands.emplace_back(l, m);
    if (plan.form == Form::per_light) {
        names.columns = {"l", "m"};
        for (const auto& [l, m] : bands) names.rows.push_back({l, m});
        return names;
    }
    names.columns = {"l_i", "m_i", "l_o", "m_o"};
    if (plan.form == Form::joint) {
        for (const JointFunction& f : joint_basis(plan.order, plan.isotropic))
            names.rows.push_back({f.l_i, f.m_i, f.l_o, f.m_o});
        return names;
    }
    for (const auto& [l, m] : bands)
        for (const auto& [k, n] : bands) names.rows.push_back({l, m, k, n});
    return names;
}

ordered_json head(const HarmonicProjection& projection) {
    const ProjectionPlan& plan = projection.plan;
    const CoefficientNames names = names_of(plan);
    ordered_json root{
        {"format", "gonio-projection"},
        {"version", format_version},
        {"quantity",
         {{"name", is_cosine(plan) ? "f_cos_cos" : "f"},
          {"meaning", is_cosine(plan) ? "f cos(theta_i) cos(theta_o)" : "f_r, no cosine inside"},
          {"unit", "1/sr"}}},
        {"conventions", conventions(plan)},
        {"provenance", ordered_json::array()}};
    for (const auto& [key, value] : projection.provenance) root["provenance"].push_back({key, value});
    root["projection"] = canonical(plan);
    root["condition_number"] = projection.condition_number;
    root["sample_noise"] = projection.sample_noise;
    if (projection.isotropy_defect)
        root["isotropy_defect"] = {{"measured", projection.isotropy_defect->first},
                                   {"noise", projection.isotropy_defect->second}};
    std::vector<int> orders;
    for (int k = 0; k <= projection.orders; ++k) orders.push_back(k);
    root["axes"] = {{{"name", "channel"}, {"values", projection.channels}},
                    {{"name", "order"},
                     {"meaning", "0: the sum of all orders; k: the k-th order of scattering alone"},
                     {"values", orders}}};
    root["shape"] = {projection.channels.size(), projection.slices()};
    if (plan.form == Form::per_light) {
        root["axes"].push_back({{"name", "incident"},
                                {"unit", "deg"},
                                {"columns", {"theta", "phi"}},
                                {"values", canonical(projection.incident)}});
        root["shape"].push_back(projection.incident.size());
    }
    root["axes"].push_back({{"name", "coefficient"}, {"columns", names.columns}, {"values", names.rows}});
    root["shape"].push_back(projection.n_coefficients());
    root["relative_error"] = projection.relative_error;
    root["ridge"] = projection.ridge;
    return root;
}

void write_json_projection(const HarmonicProjection& projection, const std::string& path) {
    ordered_json root = head(projection);
    root["coefficients"] = projection.coefficients;
    root["standard_error"] = projection.se;
    root["bias"] = projection.bias;
    write_file_atomically(path, [&](std::ostream& out) {
        out << root.dump(-1, ' ', false, ordered_json::error_handler_t::replace) << "\n";
    });
}

void write_csv(const HarmonicProjection& projection, std::ostream& out) {
    BlockWriter writer(out);
    const ProjectionPlan& plan = projection.plan;
    writer.text() += "# gonio projection, version " + std::to_string(format_version) + "\n";
    for (const std::string& line : conventions(plan)) writer.text().append("# ").append(line).append("\n");
    ordered_json fit = head(projection);
    for (const char* member :
         {"projection", "condition_number", "sample_noise", "isotropy_defect", "relative_error"})
        if (fit.contains(member))
            writer.text() += std::string("# ") + member + ": " + fit[member].dump() + "\n";
    writer.text() += "# provenance\n";
    for (const auto& [key, value] : projection.provenance) writer.text() += "# " + key + ": " + value + "\n";
    const CoefficientNames names = names_of(plan);
    std::string header = plan.form == Form::per_light ? "theta_i_deg,phi_i_deg," : "";
    for (const std::string& column : names.columns) header += column + ",";
    if (projection.orders > 0) header += "order,";
    for (const std::string& channel : projection.channels)
        header += "c_" + channel + ",se_" + channel + ",bias_" + channel + ",";
    header.back() = '\n';
    writer.text() += header;
    for (size_t set = 0; set < projection.n_sets(); ++set)
        for (size_t k = 0; k < names.rows.size(); ++k)
            for (size_t slice = 0; slice < projection.slices(); ++slice) {
                std::string& text = writer.text();
                const auto append = [&text](auto value) {
                    append_number(text, value);
                    text += ',';
                };
                if (plan.form == Form::per_light) {
                    append(projection.incident[set].theta_deg);
                    append(projection.incident[set].phi_deg);
                }
                for (const int name : names.rows[k]) append(name);
                if (projection.orders > 0) append(slice);
                for (size_t channel = 0; channel < projection.channels.size(); ++channel) {
                    const size_t at =
                        projection.set_index(channel, slice, set) * projection.n_coefficients() + k;
                    append(projection.coefficients[at]);
                    append(projection.se[at]);
                    append(projection.bias[at]);
                }
                text.back() = '\n';
            }
    writer.flush();
}

void write_csv_projection(const HarmonicProjection& projection, const std::string& path) {
    write_file_atomically(path, [&](std::ostream& out) { write_csv(projection, out); });
}

void write_npy_projection(const HarmonicProjection& projection, const std::string& path) {
    const ordered_json described = head(projection);
    write_npy_file(
        path, "[('value', '<f8'), ('se', '<f8'), ('bias', '<f8')]",
        described["shape"].get<std::vector<size_t>>(), [&](std::ostream& out) {
            for (size_t k = 0; k < projection.coefficients.size(); ++k)
                for (const auto* values : {&projection.coefficients, &projection.se, &projection.bias})
                    out.write(reinterpret_cast<const char*>(&(*values)[k]), sizeof(double));
            return described;
        });
}

// A row of pixels a set of coefficients, the first set at the top; a layer an order of scattering.
void write_exr_projection(const HarmonicProjection& projection, const std::string& path) {
    const ordered_json described = head(projection);
    Picture picture;
    picture.width = static_cast<int>(projection.n_coefficients());
    picture.height = static_cast<int>(projection.n_sets());
    for (const auto& [key, value] : described.items())
        if (key != "provenance")
            picture.attributes.emplace_back(key, value.is_string() ? value.get<std::string>() : value.dump());
    picture.attributes.insert(picture.attributes.end(), projection.provenance.begin(),
                              projection.provenance.end());
    for (size_t channel = 0; channel < projection.channels.size(); ++channel)
        for (size_t slice = 0; slice < projection.slices(); ++slice) {
            const std::string layer = slice == 0 ? "" : "order" + std::to_string(slice) + ".";
            const auto add = [&](const std::string& what, const std::vector<double>& values) {
                std::vector<float> pixels;
                for (size_t row = projection.n_sets(); row-- > 0;) {  // row 0 of a picture is the lowest
                    const auto from =
                        values.begin() + static_cast<long>(projection.set_index(channel, slice, row) *
                                                           projection.n_coefficients());
                    pixels.insert(pixels.end(), from, from + picture.width);
                }
                picture.channels.push_back(
                    {layer + what + exr_channel_name(projection.channels[channel]), std::move(pixels)});
            };
            add("", projection.coefficients);
            add("se.", projection.se);
            add("bias.", projection.bias);
        }
    write_exr_picture(picture, path);
}

}  // namespace

const std::vector<std::string>& projection_formats() {
    static const std::vector<std::string> formats = {"csv", "json", "npy", "exr"};
    return formats;
}

void write_projection(const HarmonicProjection& projection, const std::string& format,
                      const std::string& path) {
    const auto write = format == "csv"    ? write_csv_projection
                       : format == "json" ? write_json_projection
                       : format == "npy"  ? write_npy_projection
                       : format == "exr"  ? write_exr_projection
                                          : nullptr;
    if (!write)
        throw Error(ErrorCode::invalid_input, "format", format,
                    "a projection is written as csv, json, npy or exr");
    write(projection, path);
}

void add_to_report(const HarmonicProjection& projection, Report& report) {
    report.settings.emplace_back("projection", describe(projection.plan));
    const std::vector<double>& errors = projection.relative_error;
    report.counters.emplace_back("projection condition number", projection.condition_number);
    report.counters.emplace_back("projection relative error",
                                 *std::max_element(errors.begin(), errors.end()));
    if (!projection.isotropy_defect) return;
    const auto [measured, noise] = *projection.isotropy_defect;
    report.counters.emplace_back("isotropy defect", measured);
    if (measured > 3 * noise && measured > errors.front())
        report.warnings.push_back(
            "the reflectance is not isotropic: turned around z it differs by " +
            number_text(100 * measured, 2) +
            " % (rms); the joint fit averages over that. Say \"isotropic\": false, or use another form");
}

std::string describe(const ProjectionPlan& plan) {
    const nlohmann::json j = canonical(plan);
    return j["basis"].get<std::string>() + " order " + std::to_string(plan.order) + ", " +
           j["form"].get<std::string>() + ", " +
           (plan.samples > 0 ? std::to_string(plan.samples) + " samples" : std::string("quadrature grid")) +
           ", " + (is_cosine(plan) ? "cosine weighted" : "f itself");
}

}  // namespace gonio
