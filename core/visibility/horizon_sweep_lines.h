// The sheared lines of one azimuth: where their samples and the receivers' edges stand, computed once in
// double.
#pragma once
#include <cstdint>
#include <vector>

#include "visibility/crossings.h"

namespace gonio {

// Rows of `plane` are the columns that the lines cross, and its contiguous axis runs over the lines: the
// other orientation than the march takes for this azimuth. A sample stands where a line passes the receivers'
// place inside a column: then receivers and samples of a column are all equally far from what stands ahead.
struct SweepLines {
    struct Sample {
        int row;          // of the plane
        int shift;        // of line 0's cell, in [0, plane.nx)
        int line_before;  // the line just before receiver 0 of this column; the next line is just behind it
        float weight[3];  // of the cell's own node, the triangle's second one, and the opposite one
        int second_node;  // floats from the own to the second node
    };
    // An edge that the receivers' rays cross first; row and column relative to the receiver's cell, wrapped.
    struct NearEdge {
        float weight0, weight1, columns;
        int row, column, second_node;
    };

    const MarchPlane* plane = nullptr;
    bool transposed = false;  // plane is the transposed one
    bool backwards = false;   // the azimuth points against the rows' order
    float shear = 0;          // how far the lines climb a column, in [-1, 1]
    double column = 0;        // metres of travel a column
    double first_edge = 1;    // columns from a receiver to the first edge between columns, in (0, 1]
    int n_steps = 0;          // samples a line
    std::vector<Sample> samples;
    std::vector<NearEdge> near_edges;
    // The k-th edge between columns, k >= 1: where the ray of receiver 0 crosses it, in [0, plane.nx).
    std::vector<float> edge_shift;
    // [step + k]: offset in plane.heights of the nodes on the k-th edge ahead of the receivers of that step.
    std::vector<int32_t> edge_rows;
    float receiver_weight[3] = {};
    int receiver_second_node = 0;
};

SweepLines make_sweep_lines(const MarchGrid& grid, const RayBundle& flat, double travel);

}  // namespace gonio
