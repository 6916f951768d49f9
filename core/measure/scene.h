// What is measured and from where: what every transport is given.
#pragma once
#include <vector>

#include "material/material.h"
#include "measure/accuracy.h"
#include "measure/plan.h"
#include "surface/height_field.h"
#include "visibility/march_grid.h"

namespace gonio {

struct MeasuredScene {
    const HeightField* surface = nullptr;
    const MarchGrid* grid = nullptr;
    const Material* material = nullptr;
    const BrdfPlan* plan = nullptr;
    std::vector<Vec3> lights, views;  // of plan->incident and plan->outgoing
    // views[v] == lights[view_to_light[v]] for all v, and every light is a view: half the work. Empty
    // otherwise.
    std::vector<int> view_to_light;
    RowGroups groups;  // of the table's rows
    bool axes_swapped =
        false;  // of the surface against the plan's directions (simplify.h); lights, views are turned already
    bool allow_skips = true;  // as in RunOptions
    long long max_bytes = 0;  // for one run

    size_t rows() const { return groups.light.size(); }
    size_t n_channels() const { return material->channels.size(); }
    // The projected area of one period is A cos theta in truth. Not so of a part of a surface, or on a curved
    // base: there values are divided by the plain area.
    bool projected_area_is_known() const {
        return surface->border_x == 0 && surface->border_y == 0 && !surface->base.is_curved();
    }
};

}  // namespace gonio
