// "base": {"kappa_1": 20, "kappa_2": 0, "direction_deg": 30}
#include "server/job_sections.h"

namespace gonio {

BaseCurvature parse_base(const std::optional<JsonNode>& node) {
    if (!node) return {};
    node->allow_keys({"kappa_1", "kappa_2", "direction_deg", "correction"});
    constexpr double most = 1e12;  // a radius of a picometre
    BaseCurvature base{node->at("kappa_1").number(-most, most), node->at("kappa_2").number(-most, most), 0};
    if (const auto direction = node->find("direction_deg"))
        base.direction = radians(direction->number(-360, 360));
    if (const auto correction = node->find("correction")) {
        const std::string name = correction->choice({"none", "exact", "printed"});
        base.correction = name == "none"    ? BaseCorrection::none
                          : name == "exact" ? BaseCorrection::exact
                                            : BaseCorrection::printed;
    }
    if (!base.is_curved()) return {};  // the very same job as one without a base
    return base;
}

}  // namespace gonio
