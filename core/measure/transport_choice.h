// Which transport a job gets: of those that can do it, the one that is foreseen to be done first.
#pragma once
#include <memory>

#include "measure/transport.h"

namespace gonio {

struct TransportCost {
    double cpu_seconds = 0;     // of one thread, until the target is met or nothing helps
    double relative_error = 0;  // then, as Estimate::total, and what stated errors do not hold
    RunSettings settings;       // of the last stage
    int runs = 0;               // of all stages
};

// Plays the stages of a measurement with forecasts in place of runs. What max_seconds would cut short is told
// in full.
TransportCost foresee(const Transport& transport, const Accuracy& accuracy);

struct TransportChoice {
    TransportKind kind;
    std::unique_ptr<Transport> transport;
    TransportCost cost;
    Report report;  // settings transport and transport_why, and what the transport leaves out
};

// plan.transport or, for `automatic`: the one that can do it; of several, that of the smallest error at
// explicit samples, else the one of the least time to the target (or to the usual one, if a job has none). A
// function of the job alone. The scene must outlive the transport. Throws Error(invalid_input) for what
// cannot be done.
TransportChoice choose_transport(const MeasuredScene& scene);

}  // namespace gonio
