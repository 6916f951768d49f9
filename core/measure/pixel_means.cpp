#include "measure/pixel_means.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "scattering/picture_kernels.h"

namespace gonio {
namespace {

constexpr int rows_together = 8;  // of pixels, of all views: what they show stays in the cache
constexpr int few_columns = 4;    // that are summed one by one rather than a block at a time

using Lanes = std::array<float, column_block>;

}  // namespace

PixelMeans::PixelMeans(const BtfShape& shape, const std::vector<uint32_t>& view_maps, const FacetLight& light,
                       int n_threads)
    : shape_(shape),
      view_maps_(view_maps),
      light_(light),
      n_threads_(n_threads),
      lower_share_(shape.n_views) {
    const uint32_t n_parts = static_cast<uint32_t>(light.tile().n_parts()),
                   kind = static_cast<uint32_t>(shape.n_facets / (2 * n_parts));
    const size_t n_places = shape.pixel_samples * shape.n_pixels();
    parallel_for(shape.n_views, n_threads, [&](int view) {
        const uint32_t* map = &view_maps[view * n_places];
        size_t lower = 0;
        if (n_parts == 1)
            for (size_t k = 0; k < n_places; ++k) lower += map[k] < kind;
        else
            for (size_t k = 0; k < n_places; ++k) lower += map[k] % (2 * kind) < kind;
        lower_share_[view] = static_cast<double>(lower) / static_cast<double>(n_places);
    });
}

const uint32_t* PixelMeans::unknowns(int view, int sample, int row, std::vector<uint32_t>& room) const {
    const uint32_t* map =
        &view_maps_[(static_cast<size_t>(view) * shape_.pixel_samples + sample) * shape_.n_pixels() +
                    static_cast<size_t>(row) * shape_.pixels_x];
    if (light_.tile().stride == light_.tile().area.width) return map;
    for (int i = 0; i < shape_.pixels_x; ++i) room[i] = static_cast<uint32_t>(light_.unknown_of(map[i]));
    return room.data();
}

Matrix PixelMeans::of(const Fields& fields) const {
    const int n = fields.n_columns(), n_groups = (shape_.pixels_y + rows_together - 1) / rows_together;
    std::vector<std::vector<float>> columns(n <= few_columns ? n : 0);
    for (size_t c = 0; c < columns.size(); ++c) {
        columns[c].resize(fields.n_unknowns());
        for (size_t u = 0; u < fields.n_unknowns(); ++u)
            columns[c][u] = fields.block(0)[u * column_block + c];
    }
    std::vector<std::vector<double>> partial(n_groups);  // [view][column]
    parallel_for(n_groups, n_threads_, [&](int group) {
        partial[group].assign(static_cast<size_t>(shape_.n_views) * n, 0.0);
        std::vector<uint32_t> room(shape_.pixels_x);
        for (int view = 0; view < shape_.n_views; ++view)
            for (int s = 0; s < shape_.pixel_samples; ++s)
                for (int j = group * rows_together;
                     j < std::min((group + 1) * rows_together, shape_.pixels_y); ++j) {
                    const uint32_t* row = unknowns(view, s, j, room);
                    Lanes lanes{};
                    if (columns.empty())
                        add_rows(fields.block(0), row, shape_.pixels_x, lanes.data());
                    else
                        for (int c = 0; c < n; ++c)
                            lanes[c] = sum_at(columns[c].data(), row, shape_.pixels_x);
                    for (int c = 0; c < n; ++c) partial[group][static_cast<size_t>(view) * n + c] += lanes[c];
                }
    });
    const double share = 1 / (static_cast<double>(shape_.n_pixels()) * shape_.pixel_samples);
    Matrix mean(n, shape_.n_views);
    for (const std::vector<double>& sums : partial)
        for (int view = 0; view < shape_.n_views; ++view)
            for (int c = 0; c < n; ++c) mean(c, view) += share * sums[static_cast<size_t>(view) * n + c];
    return mean;
}

}  // namespace gonio
