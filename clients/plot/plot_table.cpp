#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "clients/plot/palette.h"
#include "clients/plot/panels.h"
#include "clients/plot/table_view.h"

namespace gonio {
namespace {

int choose_incident(const Table& table, const PlotOptions& options) {
    if (options.incident >= static_cast<int>(table.incident.size())) {
        throw Error(ErrorCode::invalid_input, "incident", std::to_string(options.incident),
                    "the table has " + std::to_string(table.incident.size()) +
                        " incident directions, counted from 0");
    }
    if (options.incident >= 0) return options.incident;
    int best = 0;
    for (int i = 1; i < static_cast<int>(table.incident.size()); ++i) {
        auto distance = [&](int k) { return std::abs(table.incident[k].theta_deg - 45); };
        if (distance(i) < distance(best) - 1e-9) best = i;
    }
    return best;
}

size_t choose_channel(const Table& table, const PlotOptions& options) {
    if (options.channel.empty()) return table.channels.size() / 2;
    const auto found = std::find(table.channels.begin(), table.channels.end(), options.channel);
    if (found != table.channels.end()) return found - table.channels.begin();
    std::string allowed = "one of";
    for (const std::string& channel : table.channels) allowed += " " + channel;
    throw Error(ErrorCode::invalid_input, "channel", options.channel, allowed);
}

// rms over the table of the error over f, as the accuracy of a job is defined (f no less than 1 % of the
// mean).
double relative_error(const Table& table) {
    double mean = 0, sum = 0;
    const size_t rows = table.rows(), n = table.channels.size() * rows;
    auto over_table = [&](auto&& visit) {
        for (size_t c = 0; c < table.channels.size(); ++c)
            for (size_t row = 0; row < rows; ++row) visit(table.index(c, 0, row));
    };
    over_table([&](size_t k) { mean += table.f[k] / static_cast<double>(n); });
    over_table([&](size_t k) {
        const double error = std::hypot(table.se[k], table.bias[k]),
                     f = std::max<double>(table.f[k], 0.01 * mean);
        if (f > 0) sum += error * error / (f * f);
    });
    return std::sqrt(sum / static_cast<double>(n));
}

std::string caption(const Table& table) {
    std::string text;
    for (const std::string key : {"surface", "albedo", "material", "program"}) {
        const std::string value = provenance_value(table, key);
        if (!value.empty()) text += (text.empty() ? "" : "  \u00b7  ") + key + ": " + value;
    }
    text += (text.empty() ? "" : "  \u00b7  ") + std::string("rms relative error ") +
            number_text(100 * relative_error(table), 2) + " %";
    const std::string hash = provenance_value(table, "job_hash");
    return hash.empty() ? text : text + "  \u00b7  job " + hash.substr(0, 12);
}

}  // namespace

void plot_table(const Table& table, const std::string& path, const PlotOptions& options) {
    if (table.rows() == 0 || table.channels.empty())
        throw Error(ErrorCode::invalid_input, "table", "", "there is no value to draw");
    const int incident = choose_incident(table, options);
    const size_t channel = choose_channel(table, options);
    std::string title = options.title.empty() ? provenance_value(table, "surface") : options.title;
    if (title.empty()) title = "BRDF";
    draw_figure(path, 920, 480, [&](Canvas& canvas) {
        canvas.text({24, 26}, title, 16, ink, Align::left, true);
        draw_lobes(canvas, table, incident, {24, 62}, 440);
        draw_map(canvas, table, incident, channel, options.log_scale, {498, 62}, 400);
        std::string words = caption(table);
        while (canvas.text_width(words, 9.5) > 872) words = words.substr(0, words.size() * 9 / 10) + "\u2026";
        canvas.text({24, 462}, words, 9.5, grey);
    });
}

}  // namespace gonio
