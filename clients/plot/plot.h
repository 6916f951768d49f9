// Figures for people who would rather look than read. Every function draws one figure to `path`, SVG or PNG
// by its extension, written aside and renamed like a table. Errors: Error(invalid_input) for another
// extension or for nothing to draw, Error(io).
#pragma once
#include <string>
#include <vector>

#include "fitting/ndf.h"
#include "table/table.h"

namespace gonio {

struct HarmonicProjection;

struct PlotOptions {
    std::string title;       // empty: the surface's name from the provenance
    int incident = -1;       // index of the incident direction of the map; -1: the one nearest to 45 degrees
    std::string channel;     // of the map; empty: the middle one
    bool log_scale = false;  // of the map's colours
};

// Left: polar diagram of f against theta_o in the plane of incidence, for a few incident directions (for
// several channels: one), with error bands; lines only join samples that the table holds. Right: the outgoing
// hemisphere seen from above, in colours.
void plot_table(const Table& table, const std::string& path, const PlotOptions& options = {});

// D in the planes of the fitted axes, measured and fitted, on a logarithmic axis.
void plot_ndf(const NdfResult& ndf, const std::string& path, const std::string& title = {});

// Measured lobes (those of the table that lie in the plane of incidence) and what a projection of it makes of them, of up to three
// incident directions of the table and its middle channel.
void plot_projection(const Table& table, const HarmonicProjection& projection, const std::string& path);

struct PlotSeries {
    std::string name;
    std::vector<double> x, y;
    bool is_dashed = false;  // for references and extrapolations
    int category = -1;       // series that belong together share a colour; -1: one of its own
};

struct LinePlotOptions {
    std::string title, x_label, y_label, caption;
    bool log_x = true, log_y = true;
};

// Benchmark charts. Points that are not finite, or not positive on a logarithmic axis, are left out.
void plot_lines(const std::vector<PlotSeries>& series, const std::string& path,
                const LinePlotOptions& options);

}  // namespace gonio
