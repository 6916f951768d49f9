// What is asked for: a validated measurement, with no JSON and no files left in it.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "directions/cells.h"
#include "directions/direction.h"
#include "material/material.h"
#include "measure/shards.h"
#include "surface/height_field.h"

namespace gonio {

struct Accuracy {
    // Exactly one of the three says when to stop; all empty means default_target.
    std::optional<double>
        target_relative_error;          // rms over the table of sqrt(se^2 + bias^2) / max(f, 0.01 mean f)
    std::optional<double> max_seconds;  // may also stand beside a target: whichever comes first
    struct Samples {
        int sub_samples = 1;  // points per facet and replicate for the direct term, >= 1
        int directions = 64;  // shared directions of the indirect term per replicate; >= 16 refinement^2
        int refinement = 1;   // each facet split into refinement^2 parts of constant radiosity: 1, 2 or 4
        int replicates = 8;   // independent randomisations, >= 2
    };
    std::optional<Samples> samples;  // explicit settings
    uint64_t seed = 1;

    static constexpr double default_target = 0.01;
    // Relative error to stop at; 0 if only time or settings are given.
    double target() const {
        if (target_relative_error) return *target_relative_error;
        return max_seconds || samples ? 0.0 : default_target;
    }
};

// Who carries the light; `automatic` leaves it to the material and the error that each would leave.
enum class TransportKind { automatic, diffuse, pair_graph, forward };

// A BRDF in terms of spherical harmonics instead of a table: fitting/sh_projection.h.
struct ProjectionPlan {
    enum class Basis { sh, hsh };
    enum class Weighting {
        none,   // g = f
        cosine  // g = f cos_i cos_o: bounded and symmetric
    };
    enum class Form {
        per_light,  // g(wo) for each incident direction of the plan
        matrix,     // g(wi, wo) = sum_ab C_ab y_a(wi) y_b(wo)
        joint       // the same with its symmetries: reciprocity and, if `isotropic`, turns and mirrors around z
    };
    Basis basis = Basis::hsh;
    int order = 8;  // 1 to max_harmonic_order: bands 0 to order - 1
    // Random directions per light (per_light) or side (matrix), or random pairs in all (joint); 0: a quadrature grid.
    int samples = 0;
    Weighting weighting = Weighting::cosine;
    Form form = Form::per_light;
    bool isotropic = true;  // joint
};

struct BrdfPlan {
    std::vector<AnglesDeg> incident, outgoing;  // as in Table
    std::vector<std::pair<int, int>> pairs;     // as in Table: empty for the full product
    std::vector<ReceiverCell> outgoing_cells;   // as Table::cells: empty for point directions
    int max_order = 0;                          // 0: all orders; K: orders 1..K only
    bool separate_orders = false;               // K slices of single orders beside the sum
    TransportKind transport = TransportKind::automatic;
    Accuracy accuracy;
    std::optional<ProjectionPlan> project;      // then set_projection_directions() has set the directions
};

struct RunOptions {
    int n_threads = 1;
    bool allow_skips = true;  // --no-skip: do the work that the report would say was skipped
    long long max_bytes =
        6LL << 30;  // working memory; decides how a large job is cut, so the same everywhere
    Checkpoints* checkpoints = nullptr;  // where finished shards are kept, if anywhere
    ShardTask shard_task = {};
};

}  // namespace gonio
