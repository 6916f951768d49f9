// Parts of the canonical job (job_hash.h) that kinds of measurement share. Internal to server/.
#pragma once
#include <nlohmann/json.hpp>

#include "server/job.h"

namespace gonio {

nlohmann::json canonical(const std::vector<AnglesDeg>& directions);
nlohmann::json canonical(const Accuracy& accuracy);
nlohmann::json canonical(const ProjectionPlan& plan);
nlohmann::json canonical(const BrdfPlan& plan);

}  // namespace gonio
