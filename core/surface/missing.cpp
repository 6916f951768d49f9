// Missing points by Laplace's equation: the smoothest surface through the known neighbours, with no new
// maxima or minima. (A mean of the neighbours, repeated outwards, would leave creases in the middle of a
// hole: false facets.)
#include <Eigen/Sparse>
#include <cmath>

#include "base/error.h"
#include "surface/prepare_steps.h"

namespace gonio {

size_t fill_missing(Grid& grid) {
    const size_t count = grid.heights.size();
    std::vector<int> unknown(count, -1);  // number of the missing point, or -1
    std::vector<size_t> missing;
    double known_mean = 0;
    for (size_t k = 0; k < count; ++k) {
        if (std::isnan(grid.heights[k])) {
            unknown[k] = static_cast<int>(missing.size());
            missing.push_back(k);
        } else {
            known_mean += grid.heights[k];
        }
    }
    if (missing.empty()) return 0;
    if (missing.size() == count)
        throw Error(ErrorCode::invalid_input, "/surface", "", "every point of the surface is missing");
    constexpr size_t most_missing = 1 << 22;  // one hole of so many points takes some 4 GB to solve
    if (missing.size() > most_missing)
        throw Error(ErrorCode::limit, "/surface/missing", std::to_string(missing.size()) + " missing points",
                    "at most " + std::to_string(most_missing) +
                        " can be interpolated; crop the surface to its measured part");
    known_mean /= static_cast<double>(count - missing.size());

    // The edges of the grid are free (no flux), whatever the boundary will be: a seam must not bleed into a
    // hole.
    const int n = static_cast<int>(missing.size());
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(5 * missing.size());
    for (int row = 0; row < n; ++row) {
        const size_t k = missing[row];
        const int i = static_cast<int>(k % grid.nx), j = static_cast<int>(k / grid.nx);
        int neighbours = 0;
        auto couple = [&](bool inside, size_t neighbour) {
            if (!inside) return;
            ++neighbours;
            if (unknown[neighbour] >= 0)
                entries.emplace_back(row, unknown[neighbour], -1.0);
            else
                right[row] += grid.heights[neighbour] - known_mean;
        };
        couple(i > 0, k - 1);
        couple(i + 1 < grid.nx, k + 1);
        couple(j > 0, k - grid.nx);
        couple(j + 1 < grid.ny, k + grid.nx);
        entries.emplace_back(row, row, neighbours);
    }
    Eigen::SparseMatrix<double> laplacian(n, n);
    laplacian.setFromTriplets(entries.begin(), entries.end());
    // Directly: conjugate gradients need as many steps as a hole is wide, 3 times the time for a hole of 600
    // x 600 points.
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(laplacian);
    const Eigen::VectorXd heights = solver.solve(right);
    for (int row = 0; row < n; ++row) grid.heights[missing[row]] = heights[row] + known_mean;
    return missing.size();
}

}  // namespace gonio
