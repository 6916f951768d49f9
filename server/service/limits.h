// What one user, and all together, may ask of the service. Each is an option of `gonio serve`.
#pragma once
#include <cstdint>

namespace gonio {

struct ServiceLimits {
    uint64_t document_bytes = 16 << 20;
    uint64_t surface_bytes = uint64_t{1} << 30;
    double table_bytes = double(1 << 30);       // predicted, as in Prediction
    double memory_bytes = 8 * double(1 << 30);  // predicted peak of a job
    double job_seconds = 24 * 3600;             // of computing: predicted before, stopped after
    int64_t queued_jobs = 1000;
    int64_t jobs_per_user = 200;  // queued or running
    int64_t stored_bytes = int64_t{100}
                           << 30;  // of what is kept: checkpoints go first, then the least recently used
    int event_streams = 64;
};

}  // namespace gonio
