// Process "statistics": is this the surface that was meant? Numbers, warnings and a picture, before a job is
// sent.
#include "base/sha256.h"
#include "server/job_hash.h"
#include "server/result_json.h"
#include "server/service/hillshade.h"
#include "server/service/processes.h"
#include "server/service/uploads.h"

namespace gonio {
namespace {

using nlohmann::json;

PreparedJob prepare(const json& document, Objects& objects) {
    const UploadedFiles files = resolve_uploads(document, objects);
    SurfaceSource source = parse_surface_job(files.document.dump(), {});
    read_as_untrusted(source);
    const auto surface = std::make_shared<const LoadedSurface>(load_surface(source));
    const std::string report = surface_json(*surface);
    PreparedJob prepared;
    // The report says what was done to the stored heights, too: surfaces that came out alike may differ
    // there.
    prepared.job_hash = sha256_hex("statistics\n" + program_version() + "\n" + report);
    prepared.surfaces = files.surfaces;
    prepared.run = [surface, report](const Workplace& place) {
        return std::vector<NewOutput>{
            {"report.json", "application/json", place.objects.put(report)},
            {"hillshade.png", "image/png", place.objects.put(hillshade_png(surface->surface))}};
    };
    return prepared;
}

}  // namespace

ServiceProcess statistics_process() {
    return {"statistics",
            "Statistics of a height field",
            "Size, pitch, heights, slopes, seam, warnings, and a picture in relief.",
            {"surface"},
            {"surface"},
            json::object(),
            {{"report", "the numbers, and what to look at", {{"json", "application/json"}}},
             {"hillshade", "the relief, lit from the upper left", {{"png", "image/png"}}}},
            prepare};
}

}  // namespace gonio
