#include "scattering/radiosity.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

namespace gonio {
namespace {

// Light is lost to the sky at every bounce: a ratio closer to 1 is sampling noise.
constexpr double largest_ratio = 0.99;

void make_room(const Fields& like, Fields& fields) {
    if (fields.values().size() != like.values().size() || fields.n_columns() != like.n_columns())
        fields = Fields(like.n_unknowns(), like.n_columns());
}
void make_room(const FewColumns& like, FewColumns& few) {
    few.n_columns = like.n_columns;
    few.values.resize(like.values.size());
}

double squared_norm(const Fields& fields) {
    return sampled_inner_product(fields, fields);
}
double squared_norm(const FewColumns& few) {
    double sum = 0;
    for (const float v : few.values) sum += static_cast<double>(v) * v;
    return sum;
}

// to[u] = albedo(slot of u) * from[u].
template <class Albedo>
void reflect(const float* from, int n_columns, size_t n_unknowns, const Tile& tile, Albedo&& albedo,
             int n_threads, float* to) {
    constexpr size_t chunk = 2048;
    parallel_for(static_cast<int>((n_unknowns + chunk - 1) / chunk), n_threads, [&](int task) {
        for (size_t u = task * chunk; u < std::min(n_unknowns, (task + 1) * chunk); ++u) {
            const float a = albedo(u % tile.n_slots());
            for (size_t c = u * n_columns; c < (u + 1) * n_columns; ++c) to[c] = a * from[c];
        }
    });
}
template <class Albedo>
void reflect(const Fields& from, const Tile& tile, Albedo&& albedo, int n_threads, Fields& to) {
    for (int b = 0; b < from.n_blocks(); ++b)
        reflect(from.block(b), column_block, from.n_unknowns(), tile, albedo, n_threads, to.block(b));
}
template <class Albedo>
void reflect(const FewColumns& from, const Tile& tile, Albedo&& albedo, int n_threads, FewColumns& to) {
    reflect(from.values.data(), from.n_columns, tile.n_unknowns(), tile, albedo, n_threads, to.values.data());
}

// Between the two layouts. What `to` has more of becomes 0.
void copy_columns(size_t n_unknowns, int n_columns, const float* from, size_t from_stride, float* to,
                  size_t to_stride) {
    for (size_t u = 0; u < n_unknowns; ++u)
        std::fill(std::copy_n(from + u * from_stride, n_columns, to + u * to_stride),
                  to + (u + 1) * to_stride, 0.0f);
}

}  // namespace

Radiosity::Radiosity(const Tile& tile, FacetAlbedo albedo, const RadiosityOptions& options, int n_threads,
                     const Monitor& monitor)
    : tile_(tile), albedo_(std::move(albedo)), options_(options), n_threads_(n_threads), monitor_(monitor) {
    room_.of_channel.resize(albedo_.n_channels());
    few_.of_channel.resize(albedo_.n_channels());
}

void Radiosity::set_operators(std::array<GatherOperator, 2> operators) {
    operators_.clear();
    for (const std::vector<float>& map : albedo_.maps)
        operators_.push_back({weighed_by(operators[0], tile_, map), weighed_by(operators[1], tile_, map)});
    if (albedo_.maps.empty()) operators_.push_back(std::move(operators));
}

const std::vector<Fields>& Radiosity::of(const Fields& irradiance) {
    const int n = irradiance.n_columns();
    if (n > FewColumns::most) {
        sum(irradiance, room_);
        return room_.of_channel;
    }
    FewColumns few{n, std::vector<float>(irradiance.n_unknowns() * n)};
    copy_columns(irradiance.n_unknowns(), n, irradiance.block(0), column_block, few.values.data(), n);
    sum(few, few_);
    for (size_t c = 0; c < few_.of_channel.size(); ++c) {
        make_room(irradiance, room_.of_channel[c]);
        copy_columns(irradiance.n_unknowns(), n, few_.of_channel[c].values.data(), n,
                     room_.of_channel[c].block(0), column_block);
    }
    return room_.of_channel;
}

template <class Columns>
void Radiosity::sum(const Columns& irradiance, Room<Columns>& room) {
    std::vector<Columns*> all;
    for (size_t c = 0; c < room.of_channel.size(); ++c) {
        Columns& sum = room.of_channel[c];
        make_room(irradiance, sum);
        all.push_back(&sum);
        if (albedo_.maps.empty()) {
            const float albedo = static_cast<float>(albedo_.constant[c]);
            reflect(
                irradiance, tile_, [&](size_t) { return albedo; }, n_threads_, sum);
            continue;
        }
        const std::vector<float>& map = albedo_.maps[c];
        reflect(
            irradiance, tile_, [](size_t) { return 1.0f; }, n_threads_, sum);
        if (!operators_.empty()) add_orders(operators_[c], irradiance, {1.0}, {&sum}, room);
        reflect(
            sum, tile_, [&](size_t slot) { return map[slot]; }, n_threads_, sum);
    }
    if (albedo_.maps.empty() && !operators_.empty())
        add_orders(operators_[0], irradiance, albedo_.constant, all, room);
}

// sums[c] += albedo_c^(k + 1) times what the operators made of the irradiance in k turns: they do not know
// the albedo, or know it all.
template <class Columns>
void Radiosity::add_orders(const std::array<GatherOperator, 2>& operators, const Columns& irradiance,
                           const std::vector<double>& albedos, std::vector<Columns*> sums,
                           Room<Columns>& room) {
    const double most = *std::max_element(albedos.begin(), albedos.end());
    const int wanted = options_.max_order == 0 ? options_.max_applications : options_.max_order - 1;
    const double first_norm = std::sqrt(squared_norm(irradiance));
    double norm = first_norm;
    make_room(irradiance, room.carried);
    make_room(irradiance, room.next);
    const Columns* before = &irradiance;
    std::vector<GatherSum<Columns>> to;
    for (size_t c = 0; c < sums.size(); ++c) to.push_back({sums[c], static_cast<float>(albedos[c])});
    for (int k = 0; k < wanted && norm > 0; ++k) {
        monitor_.check_cancelled();
        for (size_t c = 0; c < to.size(); ++c) to[c].factor *= static_cast<float>(albedos[c]);
        gather(operators[k % 2], tile_, *before, room.next, to, n_threads_);
        std::swap(room.carried, room.next);
        before = &room.carried;
        applications_ = std::max(applications_, k + 1);
        if (options_.max_order != 0) continue;
        const double now = std::sqrt(squared_norm(room.carried)),
                     ratio = std::min(most * now / norm, largest_ratio);
        norm = now;
        const double remainder = std::pow(most, k + 1) * now / first_norm * ratio / (1 - ratio);
        if (remainder < options_.tolerance || k + 1 == wanted) {
            remainder_ = std::max(remainder_, remainder);
            break;
        }
    }
}

}  // namespace gonio
