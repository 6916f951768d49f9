// Feeds bytes to the parser of job documents. Whatever the bytes, only Error may come out; what is accepted
// must have a name that does not depend on reading it twice, and every plan must be one that a table can
// hold.
#include <cstdint>
#include <string_view>

#include "base/error.h"
#include "server/job.h"
#include "server/job_hash.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace gonio;
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    try {
        const Job job = parse_job(text, {});
        if (job.outputs.empty()) __builtin_trap();
        if (const auto* plan = std::get_if<BrdfPlan>(&job.plan)) {
            if (plan->incident.empty() || plan->outgoing.empty()) __builtin_trap();
            for (const auto& [i, o] : plan->pairs) {
                if (i < 0 || o < 0 || i >= static_cast<int>(plan->incident.size()) ||
                    o >= static_cast<int>(plan->outgoing.size()))
                    __builtin_trap();
            }
            // "hemisphere": 1000000 is a good job whose canonical form takes a second.
            if (plan->incident.size() + plan->outgoing.size() > 10000) return 0;
        }
        const auto name = [](const Job& one) { return job_hash("", one.material.material, one.plan); };
        if (name(job) != name(parse_job(text, {}))) __builtin_trap();
    } catch (const Error& error) {
        if (std::string_view(error.what()).empty()) __builtin_trap();
    }
    return 0;
}
