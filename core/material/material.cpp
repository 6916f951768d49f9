#include "material/material.h"

#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "material/lobe_parameters.h"

namespace gonio {
namespace {

struct Checks {
    size_t n_channels;
    int nx, ny;

    void operator()(const std::string& field, const Parameter& parameter, const ParameterRange& range) const {
        const size_t n = parameter.n_channels(), cells = static_cast<size_t>(nx) * ny;
        const std::string allowed =
            "must lie in [" + number_text(range.low) + ", " + number_text(range.high) + "]";
        if (parameter.is_map() &&
            (parameter.map_nx != nx || parameter.map_ny != ny || parameter.map.size() != n * cells))
            throw Error(ErrorCode::invalid_input, field,
                        std::to_string(parameter.map_nx) + " x " + std::to_string(parameter.map_ny),
                        "a map must have a value for each of the surface's " + std::to_string(nx) + " x " +
                            std::to_string(ny) + " cells");
        if (n != 1 && !(range.by_channel && n == n_channels))
            throw Error(ErrorCode::invalid_input, field, std::to_string(n) + " values",
                        range.by_channel
                            ? "needs one value, or one a channel, that is " + std::to_string(n_channels)
                            : "must be the same for all channels");
        for (size_t c = 0; c < parameter.constant.size(); ++c)
            if (const double v = parameter.constant[c]; !(v >= range.low && v <= range.high))
                throw Error(ErrorCode::invalid_input,
                            field + (n > 1 ? "/" + std::to_string(c) : std::string()), number_text(v),
                            allowed);
        for (size_t k = 0; k < parameter.map.size(); ++k)
            // As precise as a map is: the float next to 1e-6 is allowed, too.
            if (const float v = parameter.map[k];
                !(v >= static_cast<float>(range.low) && v <= static_cast<float>(range.high)))
                throw Error(
                    ErrorCode::invalid_input,
                    field + ", column " + std::to_string(k % nx) + ", row " + std::to_string(k % cells / nx),
                    number_text(v), allowed);
    }
};

void check_sum_of_weights(const Material& material, int nx, int ny) {
    const bool mapped = std::any_of(material.lobes.begin(), material.lobes.end(),
                                    [](const WeightedLobe& part) { return part.weight.is_map(); });
    for (size_t c = 0; c < material.channels.size(); ++c)
        for (int j = 0; j < (mapped ? ny : 1); ++j)
            for (int i = 0; i < (mapped ? nx : 1); ++i) {
                double sum = 0;
                for (const WeightedLobe& part : material.lobes) sum += part.weight.at(c, i, j);
                if (sum > 1 + 1e-6)
                    throw Error(ErrorCode::invalid_input, "/material/parts", number_text(sum),
                                "the weights must add up to at most 1");
            }
}

}  // namespace

std::pair<double, double> Parameter::range() const {
    if (is_map()) {
        const auto [low, high] = std::minmax_element(map.begin(), map.end());
        return {*low, *high};
    }
    const auto [low, high] = std::minmax_element(constant.begin(), constant.end());
    return {*low, *high};
}

Parameter Parameter::for_channels(size_t n) const {
    Parameter all = *this;
    if (n_channels() != 1) return all;
    for (size_t c = 1; c < n; ++c) {
        all.constant.insert(all.constant.end(), constant.begin(), constant.end());
        all.map.insert(all.map.end(), map.begin(), map.end());
    }
    return all;
}

const Lambertian* pure_lambertian(const Material& material) {
    if (material.lobes.size() != 1) return nullptr;
    const WeightedLobe& only = material.lobes.front();
    if (only.weight.is_map() || only.weight.range().first < 1) return nullptr;
    return std::get_if<Lambertian>(&only.lobe);
}

void validate(const Material& material, int nx, int ny) {
    if (material.channels.empty())
        throw Error(ErrorCode::invalid_input, "/material", "", "needs at least one channel");
    if (material.lobes.empty())
        throw Error(ErrorCode::invalid_input, "/material", "", "needs at least one lobe");
    const Checks check{material.channels.size(), nx, ny};
    for (size_t k = 0; k < material.lobes.size(); ++k) {
        const std::string path =
            material.lobes.size() == 1 ? "/material/" : "/material/parts/" + std::to_string(k) + "/";
        check(path + "weight", material.lobes[k].weight, share_range);
        std::visit(
            [&](const auto& lobe) {
                visit_parameters(
                    lobe, [&](const char* name, const Parameter& parameter, const ParameterRange& range) {
                        check(path + name, parameter, range);
                    });
            },
            material.lobes[k].lobe);
    }
    check_sum_of_weights(material, nx, ny);
}

}  // namespace gonio
