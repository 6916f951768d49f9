#include "scattering/environment_slices.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

namespace gonio {
namespace {

constexpr int table_steps = 1024;

// One row of the map as a Fourier series of the azimuth, up to harmonic n: exact for radiance that is
// constant over each texel.
class RowHarmonics {
  public:
    RowHarmonics(const Environment& e, int n) : e_(e), cosine_(n + 1), sine_(n + 1), wave_(2 * e.nx), sine_wave_(wave_) {
        for (int k = 0; k < 2 * e.nx; ++k)
            wave_[k] = std::cos(pi * k / e.nx), sine_wave_[k] = std::sin(pi * k / e.nx);
    }
    void set_row(int channel, int row) {
        const auto waves = static_cast<long long>(wave_.size());
        for (size_t m = 0; m < cosine_.size(); ++m) {
            // Texel i is centred at phi = rotation + pi - pi (2 i + 1) / nx.
            double c = 0, s = 0;
            for (int i = 0; i < e_.nx; ++i) {
                const long long k = static_cast<long long>(m) * (2 * i + 1) % waves;
                const double radiance = e_.texel(channel, row, i);
                c += radiance * wave_[k];
                s += radiance * sine_wave_[k];
            }
            const double half = static_cast<double>(m) * pi / e_.nx,
                         unit = (m == 0 ? 1 : 2 * std::sin(half) / half) / e_.nx;
            cosine_[m] = unit * c, sine_[m] = unit * s;
        }
    }
    double at(double azimuth) const {
        const double from_left = e_.rotation + pi - azimuth;
        double sum = 0;
        for (size_t m = 0; m < cosine_.size(); ++m)
            sum += cosine_[m] * std::cos(static_cast<double>(m) * from_left) +
                   sine_[m] * std::sin(static_cast<double>(m) * from_left);
        return sum;
    }

  private:
    const Environment& e_;
    std::vector<double> cosine_, sine_, wave_, sine_wave_;
};

// Integral of sin^2(theta) d theta from 0 to the theta of cosine u.
double sine_squared_integral(double u) {
    const double theta = safe_acos(u);
    return 0.5 * (theta - u * std::sin(theta));
}

}  // namespace

SkySlice::SkySlice(const std::vector<double>& radiance, int n_channels, int map_ny, double azimuth,
                   double weight)
    : n_channels_(n_channels),
      cos_azimuth_(std::cos(azimuth)),
      sin_azimuth_(std::sin(azimuth)),
      table_((table_steps + 1) * 2 * static_cast<size_t>(n_channels)) {
    // <n, e> sin(theta) = n_z cos sin + n_phi sin^2, integrated exactly over rows of constant radiance.
    for (int c = 0; c < n_channels; ++c) {
        double along_z = 0, across = 0, u_above = 1, sine_above = 0;
        int step = table_steps;
        for (int row = 0; row < map_ny && step >= 0; ++row) {
            const double light = weight * radiance[static_cast<size_t>(c) * map_ny + row],
                         u_below = std::max(0.0, std::cos(pi * (row + 1) / map_ny));
            for (; step >= 0 && step >= u_below * table_steps; --step) {
                const double u = static_cast<double>(step) / table_steps;
                float* entry = &table_[(static_cast<size_t>(step) * n_channels + c) * 2];
                entry[0] = static_cast<float>(along_z + light * 0.5 * (u_above * u_above - u * u));
                entry[1] = static_cast<float>(across + light * (sine_squared_integral(u) - sine_above));
            }
            const double sine_below = sine_squared_integral(u_below);
            along_z += light * 0.5 * (u_above * u_above - u_below * u_below);
            across += light * (sine_below - sine_above);
            u_above = u_below, sine_above = sine_below;
        }
    }
}

void SkySlice::add(double horizon_slope, const Vec3& normal, double* irradiance) const {
    const double place = table_steps * horizon_slope / std::sqrt(1 + horizon_slope * horizon_slope);
    const int step = std::min(static_cast<int>(place), table_steps - 1);
    const double weight = place - step, across = normal.x * cos_azimuth_ + normal.y * sin_azimuth_;
    const float* low = &table_[static_cast<size_t>(step) * n_channels_ * 2];
    const float* high = low + static_cast<size_t>(n_channels_) * 2;
    for (int c = 0; c < n_channels_; ++c, low += 2, high += 2) {
        const auto part = [&](int k) { return low[k] + weight * (static_cast<double>(high[k]) - low[k]); };
        irradiance[c] += normal.z * part(0) + across * part(1);
    }
}

std::vector<SkySlice> sky_slices(const Environment& e, const std::vector<double>& azimuths) {
    const int n = static_cast<int>(azimuths.size()), rows_above = (e.ny + 1) / 2;
    RowHarmonics harmonics(e, (n - 1) / 2);
    std::vector<std::vector<double>> radiance(n,
                                              std::vector<double>(static_cast<size_t>(e.n_channels) * e.ny));
    for (int c = 0; c < e.n_channels; ++c)
        for (int row = 0; row < rows_above; ++row) {
            harmonics.set_row(c, row);
            for (int k = 0; k < n; ++k)
                radiance[k][static_cast<size_t>(c) * e.ny + row] = harmonics.at(azimuths[k]);
        }
    std::vector<SkySlice> slices;
    for (int k = 0; k < n; ++k) slices.emplace_back(radiance[k], e.n_channels, e.ny, azimuths[k], 2 * pi / n);
    return slices;
}

SplitEnvironment split_key_lights(const Environment& environment) {
    constexpr double largest_texel_deg = 3, least_share = 1.0 / 500;
    constexpr size_t most = 64;
    SplitEnvironment split{environment, {}};
    const Environment& e = environment;
    if (360.0 / e.nx > largest_texel_deg || 180.0 / e.ny > largest_texel_deg) return split;
    std::vector<double> total(e.n_channels);
    for (int c = 0; c < e.n_channels; ++c) total[c] = horizontal_irradiance(e, c);
    struct Candidate {
        double share;
        int row, column;
    };
    std::vector<Candidate> candidates;
    for (int j = 0; pi * (j + 1) / e.ny <= pi / 2; ++j)
        for (int i = 0; i < e.nx; ++i) {
            const double projected =
                pi / e.nx *
                (std::pow(std::cos(pi * j / e.ny), 2) - std::pow(std::cos(pi * (j + 1) / e.ny), 2));
            double share = 0;
            for (int c = 0; c < e.n_channels; ++c)
                if (total[c] > 0) share = std::max(share, e.texel(c, j, i) * projected / total[c]);
            if (share > least_share) candidates.push_back({share, j, i});
        }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.share > b.share; });
    candidates.resize(std::min(candidates.size(), most));
    for (const Candidate& candidate : candidates) {
        const double solid_angle =
            2 * pi / e.nx * (std::cos(pi * candidate.row / e.ny) - std::cos(pi * (candidate.row + 1) / e.ny));
        KeyLight light{candidate.row, candidate.column, {}};
        for (int c = 0; c < e.n_channels; ++c) {
            light.irradiance.push_back(solid_angle * e.texel(c, light.row, light.column));
            split.sky.radiance[(static_cast<size_t>(c) * e.ny + light.row) * e.nx + light.column] = 0;
        }
        split.key_lights.push_back(std::move(light));
    }
    return split;
}

Vec3 direction_of(const Environment& e, const KeyLight& light, double u, double v) {
    const double phi = e.rotation + pi * (1 - 2 * (light.column + u) / e.nx);
    const double high = std::cos(pi * light.row / e.ny), low = std::cos(pi * (light.row + 1) / e.ny);
    const double z = high + v * (low - high), r = safe_sqrt(1 - z * z);
    return {r * std::cos(phi), r * std::sin(phi), z};
}

Fields sky_irradiance(const MarchGrid& grid, const Tile& tile, const Environment& sky, const SubSample& place,
                      const SliceOptions& options, int n_threads, const Monitor& monitor) {
    const std::vector<double> azimuths = uniform_azimuths(options.azimuths, options.shift);
    const std::vector<SkySlice> slices = sky_slices(sky, azimuths);
    Fields irradiance(tile.n_unknowns(), sky.n_channels);
    std::fill(irradiance.values().begin(), irradiance.values().end(), 0.0f);
    const int nx = grid.rows.nx;
    for (int part = 0; part < tile.n_parts(); ++part)
        for (int kind = 0; kind < 2; ++kind) {
            const FacetPoint receiver = facet_point(kind, place.a, place.b, tile.refinement, part);
            const HorizonMap map =
                make_horizon_map(grid, azimuths, receiver, options.horizon, n_threads, monitor);
            parallel_for(tile.area.height, n_threads, [&](int row) {
                std::vector<double> sum(sky.n_channels);
                const size_t from = static_cast<size_t>((tile.area.y0 + row) % tile.ny) * nx;
                for (int column = 0; column < tile.area.width; ++column) {
                    const size_t cell = from + (tile.area.x0 + column) % nx,
                                 slot = tile.slot(kind, row, column);
                    const Vec3 normal{tile.normal_x[slot], tile.normal_y[slot], tile.normal_z[slot]};
                    std::fill(sum.begin(), sum.end(), 0.0);
                    for (size_t k = 0; k < slices.size(); ++k)
                        slices[k].add(map.slices[k].slope[cell], normal, sum.data());
                    const size_t unknown = part * tile.n_slots() + slot;
                    for (int c = 0; c < sky.n_channels; ++c)
                        irradiance.block(c / column_block)[unknown * column_block + c % column_block] =
                            static_cast<float>(tile.sqrt_area[slot] * std::max(0.0, sum[c]));
                }
            });
        }
    return irradiance;
}

}  // namespace gonio
