// A number of a material: the same everywhere, or a map with a value for every cell of the surface.
#pragma once
#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

namespace gonio {

struct Parameter {
    std::vector<double> constant;  // one value (all channels alike) or one a channel; empty if `map` is used
    // Registered to the grid: cell (i, j) of the (prepared) surface has map[(c * map_ny + j) * map_nx + i];
    // one plane (all channels alike) or one a channel.
    int map_nx = 0, map_ny = 0;
    std::vector<float> map;

    Parameter() = default;
    Parameter(double value) : constant{value} {}
    Parameter(std::initializer_list<double> values) : constant(values) {}
    Parameter(std::vector<double> values) : constant(std::move(values)) {}
    static Parameter mapped(int nx, int ny, std::vector<float> values) {
        Parameter parameter;
        parameter.map_nx = nx, parameter.map_ny = ny, parameter.map = std::move(values);
        return parameter;
    }

    bool is_map() const { return !map.empty(); }
    bool empty() const { return constant.empty() && map.empty(); }
    // Values, or planes of a map, it has: 1 or the number of channels.
    size_t n_channels() const {
        return is_map() ? map.size() / (static_cast<size_t>(map_nx) * map_ny) : constant.size();
    }
    double at(size_t channel, int i, int j) const {
        if (n_channels() == 1) channel = 0;
        return is_map() ? map[(channel * map_ny + j) * map_nx + i] : constant[channel];
    }
    std::pair<double, double> range() const;  // smallest and largest value
    Parameter for_channels(size_t n) const;   // the same with a value or plane for each of n channels
};

}  // namespace gonio
