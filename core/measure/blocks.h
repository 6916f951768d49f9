// A table cut into blocks of lights and views that are worked on together.
#pragma once
#include <vector>

#include "measure/scene.h"

namespace gonio {

// Lights and views by their numbers in the scene, and the table rows they answer. `same`: the views are the
// lights, `views` is empty, and Row::view counts lights.
struct Block {
    std::vector<int> lights, views;
    bool same = false;
    struct Row {
        size_t row;
        int light, view;  // inside the block
    };
    std::vector<Row> rows;
};

// One block for all if `same` (views are the lights); else blocks of at most `most` lights and as many views,
// or of `most_sparse` where a sparse list of pairs would waste larger products.
std::vector<Block> make_blocks(const MeasuredScene& scene, bool same, int most, int most_sparse);

}  // namespace gonio
