#include "measure/btf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/half.h"
#include "base/parallel.h"
#include "measure/accuracy.h"
#include "measure/btf_views.h"
#include "measure/describe.h"
#include "measure/facet_light.h"
#include "measure/glossy_btf.h"
#include "measure/mesh_bias.h"
#include "measure/pixel_means.h"
#include "measure/run.h"
#include "measure/run_limit.h"
#include "measure/sky_light.h"
#include "scattering/picture_kernels.h"

namespace gonio {
namespace {

constexpr int fewest_runs = 2, most_runs = 64;
constexpr int more_places = 4;  // in a pixel, times those asked for, to judge these by

std::vector<Vec3> vectors(const std::vector<AnglesDeg>& angles) {
    std::vector<Vec3> list;
    for (const AnglesDeg& a : angles) list.push_back(to_vector(a));
    return list;
}

Accuracy::Samples samples_of(const BtfPlan& plan) {
    return plan.accuracy.samples.value_or(Accuracy::Samples{1, 64, 1, fewest_runs});
}

// Bytes at the peak.
double peak_bytes(const BtfShape& shape, const Accuracy::Samples& samples, const BaseCurvature& base) {
    const double unknowns = static_cast<double>(shape.n_facets),
                 padded = (shape.n_lights + column_block - 1) / column_block * column_block,
                 channels = shape.n_channels,
                 directions =
                     static_cast<double>(samples.directions) / (samples.refinement * samples.refinement);
    // Sums over the runs; irradiance (thrice its coefficients on a curved base), two carried orders and the
    // sum of each channel for a block of lights; the links of both operators, as they are found and as they
    // are used.
    return 4 * unknowns *
               (padded * channels + column_block * (4 + 3 * (turned_coefficients(base) - 1) + channels)) +
           3.5 * 0.35 * sizeof(Link) * unknowns * directions + 50 * unknowns +
           2.0 * static_cast<double>(shape.radiance_size()) + 4.0 * static_cast<double>(shape.maps_size());
}

class Measurement {
  public:
    Measurement(const HeightField& surface, const Material& material, const BtfPlan& plan,
                const RunOptions& options, const Monitor& monitor, const Environment* environment)
        : surface_(surface),
          plan_(plan),
          options_(options),
          monitor_(monitor),
          lights_(vectors(plan.incident)),
          views_(vectors(view_angles(surface, plan))),
          limit_(plan.accuracy, fewest_runs, most_runs),
          light_(surface, material, plan.max_order, samples_of(plan), plan.accuracy.seed, options, monitor),
          bent_grid_(bent_view_grid(surface, plan)) {
        btf().shape = btf_shape(surface, material, plan, samples_of(plan).refinement);
        if (environment)
            sky_.emplace(surface, with_unit_irradiance(for_channels(*environment, btf().shape.n_channels)),
                         btf().shape.n_channels, plan.azimuths, plan.accuracy.seed, options, monitor);
        btf().mean.channels = material.channels;
        btf().mean.incident = plan.incident;
        btf().mean.outgoing = view_angles(surface, plan);
        if (const double bytes = peak_bytes(btf().shape, light_.samples(), surface.base);
            bytes > static_cast<double>(options.max_bytes))
            throw Error(ErrorCode::limit, "/measure", number(bytes / 1e9) + " GB",
                        "a BTF of " + std::to_string(btf().shape.n_facets) + " facets, " +
                            std::to_string(btf().shape.n_lights) + " lights and " +
                            std::to_string(btf().shape.n_views) + " views is more than the " +
                            number(static_cast<double>(options.max_bytes) / 1e9) +
                            " GB of working memory: crop or resample the surface, or ask for fewer lights");
    }

    BtfResult run() {
        std::vector<int> all(btf().shape.n_views);
        std::iota(all.begin(), all.end(), 0);
        btf().view_maps = view_maps(btf().shape, all, pixel_centre);
        pixel_means_.emplace(btf().shape, btf().view_maps, light_, options_.n_threads);
        look_at_other_places();
        squares_.assign(static_cast<size_t>(btf().shape.n_channels) * btf().shape.n_lights, 0.0);
        pixel_places_.assign(squares_.size(), 0.0);
        while (limit_.wants_more(n_runs(), error_)) add_run();
        finish();
        describe();
        return std::move(result_);
    }

  private:
    Btf& btf() { return result_.btf; }
    const Btf& btf() const { return result_.btf; }
    size_t rows() const { return btf().shape.n_lights * views_.size(); }
    int n_runs() const { return means_.count(); }

    void add_run() {
        monitor_.report({limit_.fraction(n_runs()), "run " + std::to_string(n_runs() + 1), error_});
        light_.start_run(n_runs());
        std::vector<float> run(btf().shape.n_channels * rows());
        size_t sum = 0;
        for (int first = 0; first < btf().shape.n_lights; first += column_block) {
            const int n = std::min(column_block, btf().shape.n_lights - first);
            const std::vector<Fields> of_sky = sky_ ? radiosity_of_sky() : std::vector<Fields>();
            const std::vector<Fields>& radiosity = sky_ ? of_sky : radiosity_of_lights(first, n);
            for (int c = 0; c < btf().shape.n_channels; ++c, ++sum) {
                add_means(radiosity[c], c, first, run);
                add_facets(radiosity[c], c, first, sum);
            }
        }
        means_.add(run);
        if (n_runs() >= fewest_runs) estimate_errors();
    }

    const std::vector<Fields>& radiosity_of_lights(int first, int n) {
        const std::vector<Vec3> lights(lights_.begin() + first, lights_.begin() + first + n);
        return light_.radiosity(lights, light_.irradiance(lights).lights);
    }
    // One column each: a channel has light of its own.
    std::vector<Fields> radiosity_of_sky() {
        std::vector<Fields> of_channel;
        const std::vector<Fields>& radiosity = light_.radiosity(sky_->irradiance(light_, n_runs()));
        for (int c = 0; c < btf().shape.n_channels; ++c) {
            Fields& own = of_channel.emplace_back(radiosity[c].n_unknowns(), 1);
            std::fill(own.values().begin(), own.values().end(), 0.0f);
            for (size_t u = 0; u < own.n_unknowns(); ++u) value(own, u, 0) = value(radiosity[c], u, c);
        }
        return of_channel;
    }

    // L / (E0 cos_i) of an exitance, or L / E of one under an environment of irradiance 1.
    double unit(int light) const { return 1 / (sky_ ? pi : pi * lights_[light].z); }
    size_t plane(int channel, int light) const {
        return static_cast<size_t>(channel) * btf().shape.n_lights + light;
    }

    std::vector<uint32_t> view_maps(const BtfShape& shape, const std::vector<int>& views,
                                    const SubSample& place) {
        return make_view_maps(surface_, bent_grid_ ? *bent_grid_ : light_.grid(), plan_, shape, views, place,
                              light_.samples().refinement, options_.n_threads, monitor_, unresolved_);
    }

    // A few views once more with more rays through the pixels: all rays of one place pass the cells in the
    // same way, which no comparison of some pixels with others would show.
    void look_at_other_places() {
        constexpr int most = 4;
        probe_shape_ = btf().shape;
        probe_shape_.n_views = std::min(most, btf().shape.n_views);
        probe_shape_.pixel_samples *= more_places;
        for (int k = 0; k < probe_shape_.n_views; ++k)
            probed_views_.push_back(static_cast<int>((k + 0.5) * btf().shape.n_views / probe_shape_.n_views));
        probe_maps_ = view_maps(probe_shape_, probed_views_, {0.81, 0.67});
        probe_means_.emplace(probe_shape_, probe_maps_, light_, options_.n_threads);
    }

    void add_means(const Fields& field, int channel, int first, std::vector<float>& run) {
        const Matrix mean = pixel_means_->of(field);
        for (int l = 0; l < mean.rows; ++l)
            for (int v = 0; v < mean.columns; ++v)
                run[channel * rows() + (first + l) * views_.size() + v] =
                    static_cast<float>(unit(first + l) * mean(l, v));
        if (n_runs() > 0) return;
        const Matrix other = probe_means_->of(field);
        for (int l = 0; l < other.rows; ++l)
            for (int k = 0; k < other.columns; ++k)
                if (const double here = mean(l, probed_views_[k]); here > 0)
                    pixel_places_[plane(channel, first + l)] +=
                        std::pow(other(l, k) / here - 1, 2) / ((1 + 1.0 / more_places) * other.columns);
    }

    // Sums over the runs, and over their squares.
    void add_facets(const Fields& field, int channel, int first, size_t at) {
        const bool is_first = n_runs() == 0;
        if (is_first) sums_.emplace_back(field.n_unknowns(), field.n_columns());
        constexpr size_t chunk = 4096;
        const int n_chunks = static_cast<int>((field.n_unknowns() + chunk - 1) / chunk);
        std::vector<std::array<float, column_block>> squares(n_chunks);
        parallel_for(n_chunks, options_.n_threads, [&](int k) {
            std::array<float, column_block> lanes{};
            const float* x = field.block(0) + k * chunk * column_block;
            float* to = sums_[at].block(0) + k * chunk * column_block;
            for (size_t u = k * chunk; u < std::min(field.n_unknowns(), (k + 1) * chunk); ++u) {
                const float area = light_.area(u);
                for (int c = 0; c < column_block; ++c) lanes[c] += area * x[c] * x[c];
                if (is_first)
                    std::copy_n(x, column_block, to);
                else
                    for (int c = 0; c < column_block; ++c) to[c] += x[c];
                x += column_block, to += column_block;
            }
            squares[k] = lanes;
        });
        for (const auto& lanes : squares)
            for (int c = 0; c < field.n_columns(); ++c) squares_[plane(channel, first + c)] += lanes[c];
    }

    void estimate_errors() {
        RowGroups groups;
        groups.n_lights = btf().shape.n_lights;
        groups.n_views = static_cast<int>(views_.size());
        for (size_t r = 0; r < rows(); ++r) {
            groups.light.push_back(static_cast<int>(r / views_.size()));
            groups.view.push_back(static_cast<int>(r % views_.size()));
        }
        Table& table = btf().mean;
        table.f.assign(means_.mean().begin(), means_.mean().end());
        table.se.clear();
        table.bias.assign(table.f.size(), 0.0f);
        double total = 0;
        for (int c = 0; c < btf().shape.n_channels; ++c) {
            const std::vector<double> se = standard_errors(means_, c * rows(), groups);
            const std::vector<double> scale =
                error_scale({means_.mean().begin() + static_cast<long>(c * rows()),
                             means_.mean().begin() + static_cast<long>((c + 1) * rows())});
            for (size_t r = 0; r < rows(); ++r) {
                table.se.push_back(static_cast<float>(se[r]));
                if (scale[r] > 0) total += std::pow(se[r] / scale[r], 2);
            }
        }
        error_ = std::sqrt(total / static_cast<double>(table.f.size()));
    }

    void finish() {
        const BtfShape& shape = btf().shape;
        btf().radiance.resize(shape.radiance_size());
        btf().pixel_se.resize(squares_.size());
        // Mean radiance over the base plane of lower facets, less that of upper ones, as seen from above.
        std::vector<double> kinds_differ(squares_.size());
        double area = 0;
        for (size_t u = 0; u < light_.tile().n_unknowns(); ++u) area += light_.area(u);
        size_t at = 0;
        for (int first = 0; first < shape.n_lights; first += column_block)
            for (int c = 0; c < shape.n_channels; ++c)
                finish_block(sums_[at++], c, first, area, kinds_differ);
        const double mesh = predict_mesh_bias(surface_).guess / std::pow(light_.samples().refinement, 2);
        std::vector<double> frames;  // of each view
        for (int view = 0; view < shape.n_views; ++view) {
            const size_t size = shape.n_pixels() * shape.pixel_samples;
            frames.push_back(
                frame_doubt(surface_, plan_, {btf().view_maps.data() + view * size, size}, view));
        }
        for (int c = 0; c < shape.n_channels; ++c)
            for (size_t row = 0; row < rows(); ++row) {
                const size_t mean = c * rows() + row, view = row % views_.size();
                const int light = static_cast<int>(row / views_.size());
                // Facets of one kind are seen more often than half the time; by how much the kinds differ is
                // known.
                const double kinds =
                    (pixel_means_->lower_share()[view] - 0.5) * kinds_differ[plane(c, light)];
                btf().mean.bias[mean] = static_cast<float>(
                    std::hypot(btf().mean.f[mean] * std::hypot(light_.remainder(), mesh, frames[view]),
                               btf().mean.f[mean] * std::sqrt(pixel_places_[plane(c, light)]), kinds));
            }
    }

    // The mean of the runs as halves, without the tile's padding; and what it says about errors.
    void finish_block(const Fields& field, int channel, int first, double area,
                      std::vector<double>& kinds_differ) {
        const BtfShape& shape = btf().shape;
        const int runs = n_runs(), n = field.n_columns();
        const size_t nx = surface_.nx, n_lines = shape.n_facets / nx;  // of facets, one behind the other
        float scale[column_block] = {};
        for (int c = 0; c < n; ++c) scale[c] = static_cast<float>(unit(first + c) / runs);
        struct Sums {
            std::array<float, column_block> squares{}, values{};
        };
        std::vector<Sums> lines(n_lines);
        parallel_for(static_cast<int>(n_lines), options_.n_threads, [&](int line) {
            const size_t facet = line * nx, u = light_.unknown_of(facet);
            const float* x = field.block(0) + u * column_block;
            for (size_t i = 0; i < nx; ++i) {
                const float part = light_.area(u + i);
                for (int c = 0; c < column_block; ++c) {
                    const float value = x[i * column_block + c];
                    lines[line].squares[c] += part * value * value;
                    lines[line].values[c] += value;
                }
            }
            uint16_t* planes[column_block];
            for (int c = 0; c < n; ++c)
                planes[c] = &btf().radiance[plane(channel, first + c) * shape.n_facets + facet];
            half_planes(x, nx, n, scale, planes);
        });
        for (int c = 0; c < n; ++c) {
            double squares = 0, lower = 0, upper = 0;
            for (size_t line = 0; line < n_lines; ++line) {
                squares += lines[line].squares[c];
                (line / surface_.ny % 2 == 0 ? lower : upper) += lines[line].values[c];
            }
            const size_t at = plane(channel, first + c);
            const double variance = std::max(0.0, (squares_[at] - squares / runs) / (runs - 1)) / area;
            btf().pixel_se[at] = unit(first + c) * std::sqrt(variance / runs);
            kinds_differ[at] = scale[c] * (lower - upper) / (0.5 * static_cast<double>(shape.n_facets));
        }
    }

    // From a pixel to what it shows, at the flattest view: curvature times the way through the relief.
    double most_turn() const {
        const auto [low, high] = std::minmax_element(surface_.heights.begin(), surface_.heights.end());
        double flattest = 0;
        for (const Vec3& view : views_) flattest = std::max(flattest, std::hypot(view.x, view.y) / view.z);
        return std::max(std::abs(surface_.base.kappa_1), std::abs(surface_.base.kappa_2)) *
               (static_cast<double>(*high) - *low) * flattest;
    }

    void describe() {
        Report& report = result_.report;
        report.relative_error = error_;
        report.target_met =
            plan_.accuracy.samples || error_ <= plan_.accuracy.target() || plan_.accuracy.target() == 0;
        light_.describe(n_runs(), report);
        report.counters.push_back({"view_rays", static_cast<double>(btf().shape.maps_size())});
        report.counters.push_back({"view_rays_unresolved", unresolved_});
        report.seconds = {{"wall", limit_.seconds()}};
        if (unresolved_ > 0)
            report.warnings.push_back(number(unresolved_) +
                                      " view rays are so nearly horizontal that they were given up");
        if (surface_.base.is_curved())
            report.warnings.push_back(
                "views are told in the frames of the pixels and lights in those of the facets that they "
                "show, "
                "which differ by up to " +
                number(degrees(most_turn())) + " degrees");
    }

    const HeightField& surface_;
    const BtfPlan& plan_;
    const RunOptions& options_;
    const Monitor& monitor_;
    std::vector<Vec3> lights_, views_;
    RunLimit limit_;
    FacetLight light_;
    std::optional<MarchGrid> bent_grid_;  // of the views
    std::optional<SkyLight> sky_;
    BtfResult result_;
    std::optional<PixelMeans> pixel_means_;
    std::vector<int> probed_views_;  // with other places of the pixels
    BtfShape probe_shape_;
    std::vector<uint32_t> probe_maps_;
    std::optional<PixelMeans> probe_means_;
    std::vector<double> pixel_places_;  // what these do to means: squared, relative, [channel][light]
    std::vector<Fields> sums_;          // over the runs, [block of lights][channel]
    std::vector<double> squares_;       // area times squares, sums over unknowns and runs, [channel][light]
    Moments means_;
    double error_ = 0, unresolved_ = 0;
};

}  // namespace

BtfResult measure_btf(const HeightField& surface, const Material& material, const BtfPlan& plan,
                      const RunOptions& options, const Monitor& monitor, const Environment* environment) {
    return Measurement(surface, material, plan, options, monitor, environment).run();
}

Prediction predict_btf(const HeightField& surface, const Material& material, const BtfPlan& plan) {
    if (!pure_lambertian(material)) return predict_glossy_btf(surface, material, plan);
    const BtfShape shape = btf_shape(surface, material, plan, samples_of(plan).refinement);
    const Accuracy::Samples samples = samples_of(plan);
    const double facets = static_cast<double>(shape.n_facets), lights = shape.n_lights;
    Prediction prediction;
    // Measured on 256 x 256 points, 81 lights and views.
    prediction.cpu_seconds =
        0.05 +
        samples.replicates * facets *
            (1e-6 + 15e-9 * samples.directions + lights * (25e-9 * samples.sub_samples)) +
        10e-9 * static_cast<double>(shape.maps_size());
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds);
    prediction.memory_bytes = (64 << 20) + peak_bytes(shape, samples, surface.base);
    prediction.table_bytes =
        2.0 * static_cast<double>(shape.radiance_size()) + 4.0 * static_cast<double>(shape.maps_size());
    return prediction;
}

}  // namespace gonio
