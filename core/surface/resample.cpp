// Steps that move nodes: crop, flip, resample, mirror.
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "surface/prepare_steps.h"

namespace gonio {
namespace {

// One output node as a weighted sum of input nodes first, first + 1, ...
struct Stencil {
    long long first = 0;
    std::vector<double> weights;
};

// Going down, output node I is the mean of the stored function, constant around each node, over [I r, (I + 1)
// r): the boxes tile the width, so means are kept and a periodic surface is merely shifted by (r - 1) / 2
// nodes. Going up, node I lies at I r, so that stored nodes stay nodes: the bilinear surface through them is
// refined, not rounded.
std::vector<Stencil> stencils(int n_in, int n_out) {
    std::vector<Stencil> result(n_out);
    const double r = static_cast<double>(n_in) / n_out;
    for (int out = 0; out < n_out; ++out) {
        Stencil& s = result[out];
        if (n_out >= n_in) {
            // Integer arithmetic: out * r in floating point may land just beside a node.
            const long long position = static_cast<long long>(out) * n_in;
            const double fraction = static_cast<double>(position % n_out) / n_out;
            s.first = position / n_out;
            s.weights = {1 - fraction};
            if (fraction > 0) s.weights.push_back(fraction);
        } else {
            const double begin = out * r, end = out + 1 == n_out ? n_in : (out + 1) * r;
            s.first = static_cast<long long>(begin);
            for (long long k = s.first; static_cast<double>(k) < end; ++k) {
                const double left = static_cast<double>(k);
                s.weights.push_back((std::min(end, left + 1) - std::max(begin, left)) / (end - begin));
            }
        }
    }
    return result;
}

int node(long long k, int n, bool periodic) {
    return periodic ? wrap_index(k, n) : static_cast<int>(std::min<long long>(k, n - 1));
}

Grid resampled_x(const Grid& grid, int nx, bool periodic) {
    Grid result{nx, grid.ny, std::vector<double>(static_cast<size_t>(nx) * grid.ny, 0.0)};
    const auto columns = stencils(grid.nx, nx);
    for (int j = 0; j < grid.ny; ++j) {
        const double* row = &grid.heights[static_cast<size_t>(j) * grid.nx];
        double* target = &result.heights[static_cast<size_t>(j) * nx];
        for (int i = 0; i < nx; ++i)
            for (size_t w = 0; w < columns[i].weights.size(); ++w)
                target[i] += columns[i].weights[w] *
                             row[node(columns[i].first + static_cast<long long>(w), grid.nx, periodic)];
    }
    return result;
}

Grid resampled_y(const Grid& grid, int ny, bool periodic) {
    Grid result{grid.nx, ny, std::vector<double>(static_cast<size_t>(grid.nx) * ny, 0.0)};
    const auto rows = stencils(grid.ny, ny);
    for (int j = 0; j < ny; ++j) {
        double* target = &result.heights[static_cast<size_t>(j) * grid.nx];
        for (size_t w = 0; w < rows[j].weights.size(); ++w) {
            const int source = node(rows[j].first + static_cast<long long>(w), grid.ny, periodic);
            const double* row = &grid.heights[static_cast<size_t>(source) * grid.nx];
            for (int i = 0; i < grid.nx; ++i) target[i] += rows[j].weights[w] * row[i];
        }
    }
    return result;
}

}  // namespace

Grid cropped(const Grid& grid, const std::array<int, 4>& crop) {
    const long long x = crop[0], y = crop[1], width = crop[2], height = crop[3];
    if (x < 0 || y < 0 || width < 1 || height < 1 || x + width > grid.nx || y + height > grid.ny)
        throw Error(ErrorCode::invalid_input, "/surface/crop",
                    "[" + std::to_string(x) + ", " + std::to_string(y) + ", " + std::to_string(width) + ", " +
                        std::to_string(height) + "]",
                    "x, y, width, height must lie inside the stored " + std::to_string(grid.nx) + " x " +
                        std::to_string(grid.ny) + " points");
    Grid result{crop[2], crop[3], {}};
    result.heights.reserve(static_cast<size_t>(width) * height);
    for (long long j = y; j < y + height; ++j) {
        const auto row = grid.heights.begin() + j * grid.nx + x;
        result.heights.insert(result.heights.end(), row, row + width);
    }
    return result;
}

void flip_rows(Grid& grid) {
    for (int j = 0; j < grid.ny / 2; ++j) {
        const auto low = grid.heights.begin() + static_cast<long long>(j) * grid.nx;
        std::swap_ranges(low, low + grid.nx,
                         grid.heights.begin() + static_cast<long long>(grid.ny - 1 - j) * grid.nx);
    }
}

Grid resampled(const Grid& grid, int nx, int ny, bool periodic) {
    // The axis that shrinks most goes first: less to carry to the other.
    if (static_cast<long long>(nx) * grid.ny <= static_cast<long long>(ny) * grid.nx)
        return resampled_y(resampled_x(grid, nx, periodic), ny, periodic);
    return resampled_x(resampled_y(grid, ny, periodic), nx, periodic);
}

// h0 .. h(n-1) h(n-1) .. h0, symmetric about the middle of the cell between the twins: every stored sample
// counts twice, so height statistics are kept, at the price of one flat cell at each mirror line (1 / n of
// the area). The other choice, h0 .. h(n-1) h(n-2) .. h1, has no flat cells but counts the first and last
// samples half and leaves a period of 2 n - 2, awkward for transforms and maps.
Grid mirrored(const Grid& grid) {
    const int nx = grid.nx == 1 ? 1 : 2 * grid.nx, ny = grid.ny == 1 ? 1 : 2 * grid.ny;
    Grid result{nx, ny, {}};
    result.heights.reserve(static_cast<size_t>(nx) * ny);
    for (int j = 0; j < ny; ++j) {
        const auto row =
            grid.heights.begin() + static_cast<long long>(j < grid.ny ? j : ny - 1 - j) * grid.nx;
        result.heights.insert(result.heights.end(), row, row + grid.nx);
        if (nx > 1)
            result.heights.insert(result.heights.end(), std::make_reverse_iterator(row + grid.nx),
                                  std::make_reverse_iterator(row));
    }
    return result;
}

}  // namespace gonio
