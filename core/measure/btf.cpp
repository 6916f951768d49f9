#include "measure/btf.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/error.h"
#include "base/half.h"
#include "base/parallel.h"
#include "measure/accuracy.h"
#include "measure/btf_views.h"
#include "measure/describe.h"
#include "measure/facet_light.h"
#include "measure/mesh_bias.h"
#include "measure/run.h"

namespace gonio {
namespace {

constexpr int fewest_runs = 2, most_runs = 64;

std::vector<Vec3> vectors(const std::vector<AnglesDeg>& angles) {
    std::vector<Vec3> list;
    for (const AnglesDeg& a : angles) list.push_back(to_vector(a));
    return list;
}

Accuracy::Samples samples_of(const BtfPlan& plan) {
    return plan.accuracy.samples.value_or(Accuracy::Samples{1, 64, 1, fewest_runs});
}

// Bytes of a Fields column, of all columns of a job, and of what is kept whatever their number.
struct Memory {
    double column, all_columns, kept;
    Memory(const BtfShape& shape, int directions, int runs, int refinement) {
        const auto padded = [](int n) { return (n + column_block - 1) / column_block * column_block; };
        const double unknowns = static_cast<double>(shape.n_facets);
        column = 4 * unknowns;
        // Sums over the runs, and the weights of the pixels.
        all_columns = column * (padded(shape.n_lights) * shape.n_channels + 2 * padded(shape.n_views));
        const double operators =
            runs * unknowns * directions / (refinement * refinement) * 0.35 * sizeof(Link);
        kept = all_columns + operators + 2.0 * static_cast<double>(shape.radiance_size()) +
               4.0 * static_cast<double>(shape.maps_size()) + 50.0 * unknowns;
    }
};

class Measurement {
  public:
    Measurement(const HeightField& surface, const Material& material, const BtfPlan& plan,
                const RunOptions& options, const Monitor& monitor)
        : surface_(surface),
          plan_(plan),
          options_(options),
          monitor_(monitor),
          lights_(vectors(plan.incident)),
          views_(vectors(view_angles(surface, plan))),
          started_(std::chrono::steady_clock::now()),
          light_(surface, material, plan.max_order, samples_of(plan), plan.accuracy.seed, options, monitor) {
        btf().shape = btf_shape(surface, material, plan, samples_of(plan).refinement);
        btf().mean.channels = material.channels;
        btf().mean.incident = plan.incident;
        btf().mean.outgoing = view_angles(surface, plan);
        columns_ = columns_at_once();
    }

    BtfResult run() {
        btf().view_maps =
            make_view_maps(surface_, light_.grid(), plan_, btf().shape, light_.samples().refinement,
                           options_.n_threads, monitor_, unresolved_);
        weigh_pixels();
        for (int first = 0; first < btf().shape.n_lights; first += columns_)
            for (int c = 0; c < btf().shape.n_channels; ++c)
                sums_.emplace_back(light_.tile().n_unknowns(),
                                   std::min(columns_, btf().shape.n_lights - first));
        squares_.assign(static_cast<size_t>(btf().shape.n_channels) * btf().shape.n_lights, 0.0);
        while (wants_more()) add_run();
        finish();
        describe();
        return std::move(result_);
    }

  private:
    Btf& btf() { return result_.btf; }
    size_t rows() const { return lights_.size() * views_.size(); }
    int n_runs() const { return means_.count(); }

    // Lights that are worked on together, a multiple of a block; decided by the job alone.
    int columns_at_once() const {
        const BtfShape& shape = result_.btf.shape;
        const Memory memory(shape, light_.samples().directions, 1, light_.samples().refinement);
        // Irradiance, the sum of each channel, the carried order of both operators and the next one.
        const double room = static_cast<double>(options_.max_bytes) - memory.kept,
                     column = memory.column * (6.0 + shape.n_channels + (light_.has_map() ? 1 : 0));
        if (room < column * column_block)
            throw Error(ErrorCode::limit, "/measure", number(memory.kept / 1e9) + " GB",
                        "a BTF of " + std::to_string(shape.n_facets) + " facets, " +
                            std::to_string(shape.n_lights) + " lights and " + std::to_string(shape.n_views) +
                            " views is more than the " +
                            number(static_cast<double>(options_.max_bytes) / 1e9) +
                            " GB of working memory: crop or resample the surface, or ask for fewer lights");
        return std::clamp(static_cast<int>(room / column) / column_block, 1, 4) * column_block;
    }

    // How much of a view each unknown fills, over sqrt(area): times radiance fields that is the mean of the
    // pixels. All pixels, and every other one: two lattices that would agree if the places of the pixels did
    // not matter.
    void weigh_pixels() {
        const BtfShape& shape = btf().shape;
        weights_ = Fields(light_.tile().n_unknowns(), shape.n_views);
        std::fill(weights_.values().begin(), weights_.values().end(), 0.0f);
        odd_weights_ = weights_;
        const double share = 1.0 / (static_cast<double>(shape.n_pixels()) * shape.pixel_samples);
        lower_share_.assign(shape.n_views, 0.0);
        const size_t kind = static_cast<size_t>(surface_.nx) * surface_.ny;
        parallel_for(shape.n_views, options_.n_threads, [&](int view) {
            long long lower = 0;
            float* all = weights_.block(view / column_block) + view % column_block;
            float* odd = odd_weights_.block(view / column_block) + view % column_block;
            const uint32_t* map =
                &btf().view_maps[static_cast<size_t>(view) * shape.pixel_samples * shape.n_pixels()];
            for (int s = 0; s < shape.pixel_samples; ++s)
                for (int j = 0; j < shape.pixels_y; ++j)
                    for (int i = 0; i < shape.pixels_x; ++i) {
                        lower += *map / kind % 2 == 0;
                        const size_t u = light_.unknown_of(*map++);
                        const float weight = static_cast<float>(share) / light_.sqrt_area(u);
                        all[u * column_block] += weight;
                        if ((i + j + s) % 2) odd[u * column_block] += weight;
                    }
            lower_share_[view] = share * static_cast<double>(lower);
        });
    }

    bool wants_more() const {
        if (n_runs() < fewest_runs) return true;
        if (plan_.accuracy.samples) return n_runs() < light_.samples().replicates;
        if (plan_.accuracy.max_seconds) {
            const double seconds =
                std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
            if (seconds * (n_runs() + 1) / n_runs() > *plan_.accuracy.max_seconds) return false;
        }
        return error_ > plan_.accuracy.target() && n_runs() < most_runs;
    }

    void add_run() {
        monitor_.report({fraction(), "run " + std::to_string(n_runs() + 1), error_});
        light_.start_run(n_runs());
        std::vector<float> run(btf().shape.n_channels * rows());
        size_t sum = 0;
        for (int first = 0; first < btf().shape.n_lights; first += columns_) {
            const int n = std::min(columns_, btf().shape.n_lights - first);
            const LightIrradiance direct =
                light_.irradiance({lights_.begin() + first, lights_.begin() + first + n});
            const Radiosity radiosity = light_.radiosity(direct.lights);
            for (int c = 0; c < btf().shape.n_channels; ++c)
                add_channel(radiosity.of_channel[c], c, first, sums_[sum++], run);
        }
        means_.add(run);
        if (n_runs() >= fewest_runs) estimate_errors();
    }

    // L / (E0 cos_i) of a field's values, before they are divided by sqrt(area).
    double unit(int light) const { return 1 / (pi * lights_[light].z); }

    void add_channel(const Fields& field, int channel, int first, Fields& sum, std::vector<float>& run) {
        const int n = field.n_columns();
        const Matrix mean = means_of(field, weights_);
        for (int l = 0; l < n; ++l)
            for (size_t v = 0; v < views_.size(); ++v)
                run[channel * rows() + (first + l) * views_.size() + v] =
                    static_cast<float>(unit(first + l) * mean(l, static_cast<int>(v)));
        constexpr size_t chunk = 4096;
        const int n_chunks = static_cast<int>((field.n_unknowns() + chunk - 1) / chunk);
        const bool is_first = n_runs() == 0;
        for (int block = 0; block < field.n_blocks(); ++block) {
            std::vector<double> squares(static_cast<size_t>(n_chunks) * column_block);
            parallel_for(n_chunks, options_.n_threads, [&](int k) {
                const size_t end = std::min(field.n_unknowns(), (k + 1) * chunk);
                float lanes[column_block] = {};
                for (size_t u = k * chunk; u < end; ++u) {
                    const float* x = field.block(block) + u * column_block;
                    float* to = sum.block(block) + u * column_block;
                    for (int c = 0; c < column_block; ++c) {
                        to[c] = is_first ? x[c] : to[c] + x[c];
                        lanes[c] += x[c] * x[c];
                    }
                }
                for (int c = 0; c < column_block; ++c) squares[k * column_block + c] = lanes[c];
            });
            for (int c = 0; c < column_block && block * column_block + c < n; ++c) {
                double& total = squares_[channel * lights_.size() + first + block * column_block + c];
                for (int k = 0; k < n_chunks; ++k) total += squares[k * column_block + c];
            }
        }
    }

    Matrix means_of(const Fields& field, const Fields& weights) const {
        Matrix mean(field.n_columns(), weights.n_columns());
        add_products(light_.tile(), {{&field, 1}}, {{&weights, 1}}, 1.0, options_.n_threads, mean);
        return mean;
    }

    void estimate_errors() {
        RowGroups groups;
        groups.n_lights = static_cast<int>(lights_.size());
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
        const int r = n_runs();
        btf().radiance.resize(shape.radiance_size());
        btf().pixel_se.resize(squares_.size());
        double area = 0;
        for (size_t u = 0; u < light_.tile().n_unknowns(); ++u) area += std::pow(light_.sqrt_area(u), 2);
        std::vector<double> pixel_places(static_cast<size_t>(shape.n_channels) * shape.n_views, 0.0);
        size_t sum = 0;
        for (int first = 0; first < shape.n_lights; first += columns_)
            for (int c = 0; c < shape.n_channels; ++c) {
                const Fields& field = sums_[sum++];
                pack(field, c, first);
                std::vector<double> squares(field.n_columns(), 0.0);
                for (int l = 0; l < field.n_columns(); ++l) {
                    const float* x = field.block(l / column_block) + l % column_block;
                    for (size_t u = 0; u < light_.tile().n_unknowns(); ++u)
                        squares[l] += static_cast<double>(x[u * column_block]) * x[u * column_block];
                    const size_t at = static_cast<size_t>(c) * shape.n_lights + first + l;
                    const double variance = std::max(0.0, (squares_[at] - squares[l] / r) / (r - 1)) / area;
                    btf().pixel_se[at] = unit(first + l) * std::sqrt(variance / r);
                }
                // All pixels against every other one, pooled over the lights of a view.
                const Matrix odd = means_of(field, odd_weights_);
                for (int l = 0; l < field.n_columns(); ++l)
                    for (int v = 0; v < shape.n_views; ++v) {
                        const double mean =
                            btf().mean.f[c * rows() + static_cast<size_t>(first + l) * shape.n_views + v];
                        const double half = 2 * unit(first + l) * odd(l, v) / r;
                        if (mean > 0)
                            pixel_places[static_cast<size_t>(c) * shape.n_views + v] +=
                                std::pow(half / mean - 1, 2) / shape.n_lights;
                    }
            }
        std::vector<double> kinds_difference;
        for (size_t plane = 0; plane < btf().pixel_se.size(); ++plane)
            kinds_difference.push_back(difference_of_kinds(plane));
        const double mesh = predict_mesh_bias(surface_).guess / std::pow(light_.samples().refinement, 2);
        for (int c = 0; c < shape.n_channels; ++c)
            for (size_t row = 0; row < rows(); ++row) {
                const size_t at = c * rows() + row, view = row % views_.size(), light = row / views_.size();
                // Facets of one kind are seen more often than half the time; by how much the kinds differ is
                // known.
                const double kinds = (lower_share_[view] - 0.5) *
                                     kinds_difference[static_cast<size_t>(c) * shape.n_lights + light];
                btf().mean.bias[at] = static_cast<float>(
                    std::hypot(btf().mean.f[at] * std::hypot(light_.remainder(), mesh),
                               btf().mean.f[at] * std::sqrt(pixel_places[c * views_.size() + view]), kinds));
            }
    }

    // Mean radiance over the base plane of lower facets, less that of upper ones, as seen from above.
    double difference_of_kinds(size_t plane) const {
        const BtfShape& shape = result_.btf.shape;
        const size_t kind = static_cast<size_t>(surface_.nx) * surface_.ny;
        double sum = 0;
        for (size_t facet = 0; facet < shape.n_facets; ++facet) {
            const double value = from_half_bits(result_.btf.radiance[plane * shape.n_facets + facet]);
            sum += facet / kind % 2 == 0 ? value : -value;
        }
        return sum / (0.5 * static_cast<double>(shape.n_facets));
    }

    // The mean of the runs as halves, without the tile's padding.
    void pack(const Fields& field, int channel, int first) {
        const BtfShape& shape = btf().shape;
        constexpr size_t chunk = 512;
        const size_t n = shape.n_facets;
        parallel_for(
            static_cast<int>((n + chunk - 1) / chunk) * field.n_blocks(), options_.n_threads, [&](int task) {
                const int block = task % field.n_blocks(),
                          lanes = std::min(column_block, field.n_columns() - block * column_block);
                const size_t begin = task / field.n_blocks() * chunk, end = std::min(n, begin + chunk);
                float scale[column_block];
                uint16_t* planes[column_block];
                for (int c = 0; c < lanes; ++c) {
                    const int light = first + block * column_block + c;
                    scale[c] = static_cast<float>(unit(light) / n_runs());
                    planes[c] = &btf().radiance[(static_cast<size_t>(channel) * shape.n_lights + light) * n];
                }
                for (size_t facet = begin; facet < end; ++facet) {
                    const size_t u = light_.unknown_of(facet);
                    const float* x = field.block(block) + u * column_block;
                    const float inverse = 1 / light_.sqrt_area(u);
                    for (int c = 0; c < lanes; ++c) planes[c][facet] = half_bits(x[c] * (scale[c] * inverse));
                }
            });
    }

    double fraction() const {
        const int planned =
            plan_.accuracy.samples ? light_.samples().replicates : std::max(fewest_runs, n_runs() + 1);
        return static_cast<double>(n_runs()) / planned;
    }

    void describe() {
        Report& report = result_.report;
        report.relative_error = error_;
        report.target_met =
            plan_.accuracy.samples || error_ <= plan_.accuracy.target() || plan_.accuracy.target() == 0;
        light_.describe(n_runs(), report);
        report.counters.push_back({"view_rays", static_cast<double>(btf().shape.maps_size())});
        report.counters.push_back({"view_rays_unresolved", unresolved_});
        report.seconds = {
            {"wall", std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count()}};
        if (unresolved_ > 0)
            report.warnings.push_back(number(unresolved_) +
                                      " view rays are so nearly horizontal that they were given up");
    }

    const HeightField& surface_;
    const BtfPlan& plan_;
    const RunOptions& options_;
    const Monitor& monitor_;
    std::vector<Vec3> lights_, views_;
    std::chrono::steady_clock::time_point started_;
    FacetLight light_;
    BtfResult result_;
    int columns_ = 0;
    Fields weights_, odd_weights_;
    std::vector<double> lower_share_;  // of the places of a view that show lower facets
    std::vector<Fields> sums_;         // over the runs, [group of lights][channel]
    std::vector<double> squares_;      // sums over unknowns and runs, [channel][light]
    Moments means_;
    double error_ = 0, unresolved_ = 0;
};

}  // namespace

BtfResult measure_btf(const HeightField& surface, const Material& material, const BtfPlan& plan,
                      const RunOptions& options, const Monitor& monitor) {
    return Measurement(surface, material, plan, options, monitor).run();
}

Prediction predict_btf(const HeightField& surface, const Material& material, const BtfPlan& plan) {
    const BtfShape shape = btf_shape(surface, material, plan, samples_of(plan).refinement);
    const Accuracy::Samples samples = samples_of(plan);
    const double facets = static_cast<double>(shape.n_facets), lights = shape.n_lights;
    const Memory memory(shape, samples.directions, 1, samples.refinement);
    Prediction prediction;
    // Measured on 256 x 256 points, 81 lights and views.
    prediction.cpu_seconds =
        0.05 +
        samples.replicates * facets *
            (1e-6 + 15e-9 * samples.directions + lights * (25e-9 * samples.sub_samples)) +
        10e-9 * static_cast<double>(shape.maps_size());
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds);
    prediction.memory_bytes =
        (64 << 20) + memory.kept + memory.column * column_block * 4 * (6 + shape.n_channels);
    prediction.table_bytes =
        2.0 * static_cast<double>(shape.radiance_size()) + 4.0 * static_cast<double>(shape.maps_size());
    return prediction;
}

}  // namespace gonio
