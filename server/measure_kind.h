// What the server knows of a kind of measurement. A new kind is one file kind_NAME.cpp that makes a
// MeasureKind, an alternative of MeasurePlan (job.h) and a line in measure_kinds.cpp; README.md lists the
// rest. Internal to server/.
#pragma once
#include <string>
#include <vector>

#include "base/monitor.h"
#include "measure/prediction.h"
#include "server/job.h"
#include "server/json_node.h"
#include "server/run_job.h"

namespace gonio {

struct MeasureKind {
    std::string name;    // of "kind" in the job document, and of its process of the service
    std::string output;  // what the service calls its product: "table"
    // Of "output" in the job document, each one file; the first is the default. They are also the files'
    // extensions.
    std::vector<std::string> formats;
    // The plan, of this kind's alternative; every plan has a member `accuracy`. Throws Error with pointers
    // below `measure`.
    MeasurePlan (*parse)(const JsonNode& measure, const Accuracy& accuracy);
    // Everything of the plan that decides the result, defaults filled in, "kind" included (job_hash.h).
    nlohmann::json (*canonical)(const MeasurePlan& plan);
    Prediction (*predict)(const LoadedJob& job);
    // Measures and writes every file: whole or not at all (base/atomic_file.h), with job_provenance() in its
    // first or last 2 MiB. Large products are streamed. The folders of the files are there. Throws Error, also
    // cancelled.
    Report (*run)(const LoadedJob& job, const std::vector<OutputRequest>& files, const RunOptions& options,
                  const Monitor& monitor);
    // Where the light comes from: directions of its own, the "environment" of the job, or either of the two,
    // "incident" or "environment".
    enum class Light { directions, environment, either } light = Light::directions;
    // Whether the service keeps this job's product in a format of its process; null: in all of them.
    bool (*is_served)(const LoadedJob& job, const std::string& format) = nullptr;
};

// In the order of the alternatives of MeasurePlan.
const std::vector<MeasureKind>& measure_kinds();
const MeasureKind& kind_of(const MeasurePlan& plan);

// What a job of this plan gives: its kind's product, or the projection of a table.
struct Product {
    std::string name;                  // of the output of its process of the service
    std::vector<std::string> formats;  // as in MeasureKind
};
Product product_of(const MeasurePlan& plan);

// One file each.
MeasureKind brdf_kind();  // kind_brdf.cpp
MeasureKind btf_kind();
MeasureKind relight_kind();
MeasureKind maps_kind();
MeasureKind light_field_kind();  // kind_btf.cpp

}  // namespace gonio
