#include "server/measure_kind.h"

namespace gonio {

const std::vector<MeasureKind>& measure_kinds() {
    static const std::vector<MeasureKind> kinds = {brdf_kind(), btf_kind(), maps_kind(), light_field_kind()};
    return kinds;
}

const MeasureKind& kind_of(const MeasurePlan& plan) {
    return measure_kinds().at(plan.index());
}

}  // namespace gonio
