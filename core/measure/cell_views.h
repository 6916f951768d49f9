// Receiver cells for transports that answer directions: in every run each cell is seen from a few directions,
// in the same places of all cells, moved at random from run to run. Their mean is the mean over the cell, and
// what it misses shows between the runs.
#pragma once
#include "measure/run.h"

namespace gonio {

// So many, growing with what refines the direct term.
int directions_per_cell(const RunSettings& settings);

// What is done at each of them: places are sub-samples, too, and facets are cut into more only where those do
// not suffice.
RunSettings settings_of_place(const RunSettings& settings);

// Views that one run answers.
int views_of_run(const MeasuredScene& scene, const RunSettings& settings);

// The scene of one run: for the views of its plan's cells the directions inside, those of a cell side by
// side.
void look_into_cells(MeasuredScene& scene, int per_cell, const RunShifts& shifts);

// The run of such a scene with a value for each cell again.
void average_cells(RunValues& values, int per_cell);

// A run of `context` by run_directions(context, settings), through cells if its plan has them.
template <class Context, class Run>
RunValues run_with_cells(const Context& context, const RunSettings& settings, int stage, int run,
                         Run&& run_directions) {
    if (context.plan->outgoing_cells.empty()) return run_directions(context, settings);
    const int per_cell = directions_per_cell(settings);
    Context inside = context;
    look_into_cells(inside, per_cell, RunShifts(context.plan->accuracy.seed, stage, run));
    RunValues values = run_directions(inside, settings_of_place(settings));
    average_cells(values, per_cell);
    return values;
}

}  // namespace gonio
