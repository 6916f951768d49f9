#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "clients/plot/axis.h"
#include "clients/plot/frame.h"
#include "clients/plot/palette.h"
#include "clients/plot/plot.h"

namespace gonio {
namespace {

bool is_drawable(double value, bool is_log) {
    return std::isfinite(value) && (!is_log || value > 0);
}

}  // namespace

void plot_lines(const std::vector<PlotSeries>& series, const std::string& path,
                const LinePlotOptions& options) {
    const double inf = std::numeric_limits<double>::infinity();
    double x_low = inf, x_high = -inf, y_low = inf, y_high = -inf;
    std::vector<std::vector<Point>> curves;  // in data units
    for (const PlotSeries& s : series) {
        std::vector<Point>& curve = curves.emplace_back();
        for (size_t k = 0; k < std::min(s.x.size(), s.y.size()); ++k) {
            if (!is_drawable(s.x[k], options.log_x) || !is_drawable(s.y[k], options.log_y)) continue;
            curve.push_back({s.x[k], s.y[k]});
            x_low = std::min(x_low, s.x[k]), x_high = std::max(x_high, s.x[k]);
            y_low = std::min(y_low, s.y[k]), y_high = std::max(y_high, s.y[k]);
        }
    }
    if (!(x_low <= x_high)) throw Error(ErrorCode::invalid_input, "series", "", "there is no point to draw");

    const double width = 640, height = 440, legend_row = 16;
    draw_figure(
        path, width, height + legend_row * static_cast<double>((series.size() + 1) / 2), [&](Canvas& canvas) {
            canvas.text({20, 24}, options.title, 15, ink, Align::left, true);
            const Frame frame{{78, 46},
                              width - 100,
                              height - 120,
                              enclosing_scale(x_low, x_high, options.log_x),
                              enclosing_scale(y_low, y_high, options.log_y)};
            frame.draw(canvas, options.x_label, options.y_label);
            for (size_t k = 0; k < curves.size(); ++k) {
                std::vector<Point> points;
                for (const Point& p : curves[k]) points.push_back(frame.at(p.x, p.y));
                const Colour colour = category_colour(series[k].category < 0 ? k : series[k].category);
                canvas.line(points, colour, 2, series[k].is_dashed);
                if (!series[k].is_dashed)
                    for (const Point& p : points) canvas.disk(p, 3.2, colour);
                const Point key{frame.corner.x + (k % 2 ? 0.5 * frame.width : 0),
                                height - 22 + legend_row * static_cast<double>(k / 2)};
                canvas.line({{key.x, key.y}, {key.x + 24, key.y}}, colour, 2, series[k].is_dashed);
                canvas.text({key.x + 30, key.y}, series[k].name, 11, ink);
            }
            canvas.text({20, height + legend_row * static_cast<double>((series.size() + 1) / 2) - 10},
                        options.caption, 9.5, grey);
        });
}

}  // namespace gonio
