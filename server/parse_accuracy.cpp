#include "server/job_sections.h"

namespace gonio {
namespace {

constexpr double min_relative_error = 1e-6;  // below it, float tables say nothing
constexpr double max_relative_error = 0.999;
constexpr double min_seconds = 1e-3, max_seconds = 1e7;

int setting(const JsonNode& samples, const std::string& key, uint64_t low, uint64_t high, int otherwise) {
    const std::optional<JsonNode> node = samples.find(key);
    return node ? static_cast<int>(node->whole_number(low, high)) : otherwise;
}

Accuracy::Samples parse_samples(const JsonNode& samples) {
    samples.allow_keys({"sub_samples", "directions", "refinement", "replicates"});
    Accuracy::Samples s;
    s.sub_samples = setting(samples, "sub_samples", 1, 1024, s.sub_samples);
    s.directions = setting(samples, "directions", 1, 1 << 20, s.directions);
    s.replicates = setting(samples, "replicates", 2, 4096, s.replicates);
    if (const auto node = samples.find("refinement")) {
        s.refinement = static_cast<int>(node->whole_number(1, 4));
        if (s.refinement == 3) node->refuse("must be 1, 2 or 4");
    }
    return s;
}

}  // namespace

Accuracy parse_accuracy(const std::optional<JsonNode>& node) {
    Accuracy accuracy;
    if (node) {
        node->allow_keys({"target_relative_error", "max_seconds", "samples", "seed"});
        if (const auto target = node->find("target_relative_error")) {
            accuracy.target_relative_error = target->number(min_relative_error, max_relative_error);
        }
        if (const auto seconds = node->find("max_seconds")) {
            accuracy.max_seconds = seconds->number(min_seconds, max_seconds);
        }
        if (const auto samples = node->find("samples")) {
            if (accuracy.target_relative_error || accuracy.max_seconds) {
                samples->refuse("fixes the effort: leave out target_relative_error and max_seconds");
            }
            accuracy.samples = parse_samples(*samples);
        }
        if (const auto seed = node->find("seed")) accuracy.seed = seed->whole_number(0, UINT64_MAX);
    }
    if (!accuracy.target_relative_error && !accuracy.max_seconds && !accuracy.samples) {
        accuracy.target_relative_error = 0.01;
    }
    return accuracy;
}

}  // namespace gonio
