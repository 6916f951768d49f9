// Parsers of the sections of a job document, one file each. Internal to server/.
#pragma once
#include "server/job.h"
#include "server/json_node.h"

namespace gonio {

SurfaceSource parse_surface(const JsonNode& node, const std::string& folder);  // parse_surface.cpp
GeneratedSurface parse_generated_surface(const JsonNode& node);                // parse_generated_surface.cpp
MaterialSource parse_material(const JsonNode& node, const std::string& folder);  // parse_material.cpp
BaseCurvature parse_base(const std::optional<JsonNode>& node);  // parse_base.cpp; flat if it is not there
EnvironmentSource parse_environment(const JsonNode& node, const std::string& folder);  // parse_environment.cpp
// Every default filled in, the target included.
Accuracy parse_accuracy(const std::optional<JsonNode>& node);   // parse_accuracy.cpp
std::vector<AnglesDeg> parse_directions(const JsonNode& node);  // parse_directions.cpp
// Sets incident, outgoing and pairs of the plan from "incident" and "outgoing", or from "pairs_deg".
void parse_direction_pairs(const JsonNode& measure, BrdfPlan& plan);     // parse_directions.cpp
// "max_order" of a measurement: 0 for "all", which is the default.
int parse_max_order(const JsonNode& measure);  // parse_brdf.cpp
int parse_azimuths(const JsonNode& node);      // parse_environment.cpp; of the horizon slices
// Sets project and, from it, the directions of the plan, whose accuracy must be set.
void parse_projection(const JsonNode& measure, BrdfPlan& plan);          // parse_projection.cpp
BrdfPlan parse_brdf(const JsonNode& measure, const Accuracy& accuracy);  // parse_brdf.cpp

// `path` against `folder` unless it is absolute.
std::string resolved(const std::string& path, const std::string& folder);

}  // namespace gonio
