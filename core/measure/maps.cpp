#include "measure/maps.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "directions/gonio_grid.h"
#include "measure/describe.h"
#include "measure/facet_light.h"
#include "measure/glossy_pixels.h"
#include "measure/run_limit.h"

namespace gonio {
namespace {

constexpr int fewest_runs = 2, most_runs = 64;
constexpr int columns_at_once = 4 * column_block;

std::string numbered(const std::string& name, size_t k) {
    std::string digits = std::to_string(k);
    return name + std::string(3 - std::min<size_t>(3, digits.size()), '0') + digits;
}

Accuracy::Samples samples_of(const MapsPlan& plan) {
    return plan.accuracy.samples.value_or(Accuracy::Samples{4, 64, 1, fewest_runs});
}

// Facets as FacetLight takes them; where they are glossy, it tells lit from shadowed alone.
Material lambertian_or_black(const Material& material) {
    return pure_lambertian(material) ? material : Material{material.channels, Lambertian{0.0}};
}

// The mean of independent runs of one layer, and what they say about its error.
struct LayerSum {
    MapLayer layer;
    std::vector<double> sum, squares;
    bool is_light = false;
    // Whose light it is that came over other facets, where these are glossy.
    struct Indirect {
        size_t light, channel;
    };
    std::optional<Indirect> indirect;
};

class Measurement {
  public:
    Measurement(const HeightField& surface, const Material& material, const MapsPlan& plan,
                const RunOptions& options, const Monitor& monitor)
        : surface_(surface),
          channels_(material.channels),
          plan_(plan),
          monitor_(monitor),
          n_cells_(static_cast<size_t>(surface.nx) * surface.ny),
          limit_(plan.accuracy, fewest_runs, most_runs),
          facets_(lambertian_or_black(material)),
          light_(surface, facets_, plan.max_order, samples_of(plan), plan.accuracy.seed, options, monitor) {
        if (pure_lambertian(material)) return;
        lamps_.incident = plan.incident;
        lamps_.max_order = plan.max_order;
        lamps_.accuracy = plan.accuracy;
        glossy_.emplace(surface, material, lamps_, samples_of(plan), options, monitor);
    }

    MapsResult run() {
        while (limit_.wants_more(runs_, error_)) {
            monitor_.report({limit_.fraction(runs_), "run " + std::to_string(runs_ + 1), error_});
            light_.start_run(runs_);
            next_ = 0;
            add_lights();
            add_masks();
            add_sky();
            if (glossy_) glossy_->forget_runs();
            ++runs_;
            if (runs_ >= fewest_runs) estimate_errors();
        }
        MapsResult result;
        result.maps.nx = surface_.nx;
        result.maps.ny = surface_.ny;
        for (LayerSum& sum : layers_) {
            for (const double s : sum.sum) sum.layer.pixels.push_back(static_cast<float>(s / runs_));
            result.maps.layers.push_back(std::move(sum.layer));
        }
        light_.describe(runs_, result.report);
        if (glossy_) glossy_->describe(result.report);
        if (glossy_ && glossy_->has_narrow_lobes())
            result.report.warnings.push_back(
                "the lobes are narrower than the shared directions are dense: indirect light is rough, and "
                "what "
                "may be missed is in the se of its layers; ask for more directions");
        result.report.relative_error = error_;
        result.report.target_met =
            plan_.accuracy.samples || plan_.accuracy.target() == 0 || error_ <= plan_.accuracy.target();
        result.report.seconds = {{"wall", limit_.seconds()}};
        return result;
    }

  private:
    // Adds one run of the next layer: value(unknown) of every facet part, averaged over a cell.
    template <class Value>
    void add(const std::string& name, bool is_light, Value&& value) {
        if (next_ == layers_.size()) {
            layers_.emplace_back();
            layers_.back().layer.name = name;
            layers_.back().is_light = is_light;
            layers_.back().sum.assign(n_cells_, 0.0);
            layers_.back().squares.assign(n_cells_, 0.0);
        }
        LayerSum& layer = layers_[next_++];
        const size_t n_facets = light_.tile().n_parts() * 2 * n_cells_;
        std::vector<double> cells(n_cells_, 0.0);
        for (size_t facet = 0; facet < n_facets; ++facet)
            cells[facet % n_cells_] += value(light_.unknown_of(facet));
        const double share = static_cast<double>(n_cells_) / static_cast<double>(n_facets);
        for (size_t k = 0; k < n_cells_; ++k) {
            layer.sum[k] += share * cells[k];
            layer.squares[k] += share * cells[k] * share * cells[k];
        }
    }

    static const float* column_of(const Fields& fields, int column) {
        return fields.block(column / column_block) + column % column_block;
    }

    void add_lights() {
        if (glossy_ && !plan_.incident.empty()) glossy_->add_run();
        for (size_t first = 0; first < plan_.incident.size(); first += columns_at_once) {
            const std::vector<Vec3> lights = vectors(plan_.incident, first);
            const LightIrradiance direct = light_.irradiance(lights);
            const std::vector<Fields>* all = glossy_ ? nullptr : &light_.radiosity(lights, direct.lights);
            // The first order alone: the albedo once, no operator.
            for (size_t l = 0; l < lights.size(); ++l) {
                const std::string name = numbered("light", first + l);
                const int column = static_cast<int>(l);
                const float* lit = column_of(direct.lights, column);
                const double unit = 1 / lights[l].z;
                for (int c = 0; c < light_.n_channels(); ++c) {
                    if (glossy_) {
                        add_light(
                            name, c,
                            [&](size_t u) { return unit * glossy_->direct_irradiance(u, first + l); },
                            [&](size_t u) { return unit * glossy_->indirect_irradiance(u, c, first + l); });
                        for (size_t back : {1, 2})  // indirect, total
                            layers_[next_ - back].indirect = {first + l, static_cast<size_t>(c)};
                        continue;
                    }
                    const float* total = column_of((*all)[c], column);
                    const auto direct_of = [&](size_t u) {
                        return unit * light_.albedo_of(c, u) * lit[u * column_block];
                    };
                    add_light(name, c, direct_of, [&](size_t u) {
                        return std::max(0.0, unit * total[u * column_block] - direct_of(u));
                    });
                }
                add_share(name + ".shadow", lights[l], lit);
            }
        }
    }

    template <class Direct, class Indirect>
    void add_light(const std::string& name, int channel, Direct&& direct, Indirect&& indirect) {
        add(name + ".direct." + channels_[channel], true, direct);
        add(name + ".indirect." + channels_[channel], true, indirect);
        add(name + ".total." + channels_[channel], true, [&](size_t u) { return direct(u) + indirect(u); });
    }

    void add_masks() {
        for (size_t first = 0; first < plan_.outgoing.size(); first += columns_at_once) {
            const std::vector<Vec3> views = vectors(plan_.outgoing, first);
            const LightIrradiance seen = light_.irradiance(views);
            for (size_t v = 0; v < views.size(); ++v)
                add_share(numbered("view", first + v) + ".mask", views[v],
                          column_of(seen.lights, static_cast<int>(v)));
        }
    }

    // Visible share of a part: its irradiance over the unoccluded one.
    void add_share(const std::string& name, const Vec3& d, const float* factor) {
        const Tile& tile = light_.tile();
        add(name, false, [&](size_t u) {
            const size_t slot = u % tile.n_slots();
            const double cosine =
                tile.normal_x[slot] * d.x + tile.normal_y[slot] * d.y + tile.normal_z[slot] * d.z;
            return cosine > 1e-6 ? std::min(1.0, factor[u * column_block] / cosine) : 0.0;
        });
    }

    // Directions of equal projected solid angle over the base plane, pi / n each: their solid angle is that
    // over d.z.
    void add_sky() {
        if (plan_.sky_directions == 0) return;
        std::vector<double> sky(light_.tile().n_unknowns(), 0.0);
        std::vector<AnglesDeg> set = equal_projected_hemisphere(plan_.sky_directions);
        // Turned from run to run by the golden angle, so that the runs tell what the choice of directions
        // does.
        for (AnglesDeg& direction : set) direction.phi_deg += 222.4922359 * runs_;
        for (size_t first = 0; first < set.size(); first += columns_at_once) {
            const std::vector<Vec3> directions = vectors(set, first);
            const LightIrradiance seen = light_.irradiance(directions);
            for (size_t d = 0; d < directions.size(); ++d) {
                const float* factor = column_of(seen.lights, static_cast<int>(d));
                const double weight = 1 / (static_cast<double>(set.size()) * directions[d].z);
                for (size_t u = 0; u < sky.size(); ++u) sky[u] += weight * factor[u * column_block];
            }
        }
        add("sky", false, [&](size_t u) { return sky[u]; });
    }

    static std::vector<Vec3> vectors(const std::vector<AnglesDeg>& angles, size_t first) {
        std::vector<Vec3> list;
        for (size_t k = first; k < std::min(angles.size(), first + columns_at_once); ++k)
            list.push_back(to_vector(angles[k]));
        return list;
    }

    void estimate_errors() {
        error_ = 0;
        for (LayerSum& sum : layers_) {
            double mean = 0, variance = 0;
            for (size_t k = 0; k < n_cells_; ++k) {
                mean += sum.sum[k] / runs_;
                variance += std::max(0.0, sum.squares[k] - sum.sum[k] * sum.sum[k] / runs_) / (runs_ - 1);
            }
            const double n = static_cast<double>(n_cells_);
            sum.layer.mean = mean / n;
            sum.layer.se = std::sqrt(variance / n / runs_);
            // Light that arrives over narrow lobes no pair may meet. What leaves after two reflections and
            // more stands for what arrived by them: a little less.
            if (sum.indirect)
                sum.layer.se = std::hypot(
                    sum.layer.se, pi * glossy_->undersampled(sum.indirect->channel, sum.indirect->light,
                                                             sum.layer.mean / pi));
            if (sum.is_light && sum.layer.name.find(".total.") != std::string::npos && sum.layer.mean > 0)
                error_ = std::max(error_, sum.layer.se / sum.layer.mean);
        }
    }

    const HeightField& surface_;
    const std::vector<std::string>& channels_;
    const MapsPlan& plan_;
    const Monitor& monitor_;
    size_t n_cells_;
    RunLimit limit_;
    Material facets_;
    FacetLight light_;
    BtfPlan lamps_;  // what glossy_ is lit by
    std::optional<GlossyPixels> glossy_;
    std::vector<LayerSum> layers_;
    size_t next_ = 0;
    int runs_ = 0;
    double error_ = 0;
};

double layers_of(const Material& material, const MapsPlan& plan) {
    return static_cast<double>(plan.incident.size()) *
               (3.0 * static_cast<double>(material.channels.size()) + 1) +
           static_cast<double>(plan.outgoing.size()) + (plan.sky_directions > 0);
}

double memory_of(const HeightField& surface, const Material& material, const MapsPlan& plan) {
    const double cells = static_cast<double>(surface.nx) * surface.ny;
    const Accuracy::Samples samples = samples_of(plan);
    const double unknowns = 2 * cells * samples.refinement * samples.refinement;
    return 100 * cells + 20 * cells * layers_of(material, plan) +
           4 * unknowns * columns_at_once *
               (6 + 2.5 * (turned_coefficients(surface.base) - 1) +
                static_cast<double>(material.channels.size())) +
           2 * cells * samples.directions * 0.35 * sizeof(Link);
}

}  // namespace

MapsResult measure_maps(const HeightField& surface, const Material& material, const MapsPlan& plan,
                        const RunOptions& options, const Monitor& monitor) {
    if (const double bytes = memory_of(surface, material, plan);
        bytes > static_cast<double>(options.max_bytes))
        throw Error(ErrorCode::limit, "/measure", number(bytes / 1e9) + " GB",
                    "more than the " + number(static_cast<double>(options.max_bytes) / 1e9) +
                        " GB of working memory: crop or resample the surface, or ask for fewer lights");
    return Measurement(surface, material, plan, options, monitor).run();
}

Prediction predict_maps(const HeightField& surface, const Material& material, const MapsPlan& plan) {
    const double cells = static_cast<double>(surface.nx) * surface.ny;
    const Accuracy::Samples samples = samples_of(plan);
    const double rays =
        static_cast<double>(plan.incident.size() + plan.outgoing.size()) + plan.sky_directions;
    Prediction prediction;
    prediction.cpu_seconds =
        0.05 + samples.replicates * 2 * cells * samples.refinement * samples.refinement *
                   (1e-6 + 15e-9 * samples.directions + 25e-9 * rays * samples.sub_samples);
    prediction.memory_bytes = (64 << 20) + memory_of(surface, material, plan);
    prediction.table_bytes = 4 * cells * layers_of(material, plan);
    return prediction;
}

}  // namespace gonio
