#include "server/measure_kind.h"
#include "server/projection_file.h"

namespace gonio {

const std::vector<MeasureKind>& measure_kinds() {
    static const std::vector<MeasureKind> kinds = {brdf_kind(), btf_kind(), maps_kind(), light_field_kind(),
                                                   relight_kind()};
    return kinds;
}

const MeasureKind& kind_of(const MeasurePlan& plan) {
    return measure_kinds().at(plan.index());
}

Product product_of(const MeasurePlan& plan) {
    const auto* brdf = std::get_if<BrdfPlan>(&plan);
    if (brdf && brdf->project) return {"projection", projection_formats()};
    return {kind_of(plan).output, kind_of(plan).formats};
}

}  // namespace gonio
