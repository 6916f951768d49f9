// What a job will cost, said before it runs: from its settings and constants measured on other jobs. Rough by
// nature: on twelve jobs of 0.06 to 15 s the CPU time predicted was 0.85 to 2.4 times what they took.
#pragma once
#include "measure/reference.h"

namespace gonio {

struct Prediction {
    double cpu_seconds = 0;   // of one thread
    double memory_bytes = 0;  // at its peak, one run at a time
    double table_bytes = 0;   // of the result; of tables: values, standard errors and biases, as doubles
};

// max_bytes: RunOptions::max_bytes, to which runs are cut.
Prediction predict_brdf(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                        long long max_bytes = RunOptions{}.max_bytes);
Prediction predict_reference(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                             const ReferenceOptions& reference);

}  // namespace gonio
