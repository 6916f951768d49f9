// The two halves of the figure of a table.
#pragma once
#include "clients/plot/canvas.h"
#include "clients/plot/plot.h"

namespace gonio {

// Both draw into a box `width` wide whose top left corner is `corner`.
void draw_lobes(Canvas& canvas, const Table& table, int map_incident, Point corner, double width);
void draw_map(Canvas& canvas, const Table& table, int incident, size_t channel, bool log_scale, Point corner,
              double width);

}  // namespace gonio
