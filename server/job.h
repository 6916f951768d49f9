// The job document as nouns: what the command line, the batch runner and the HTTP service share.
// server/README.md is its reference, job_schema.json its JSON Schema; tests hold the three together. No JSON
// is left past this header.
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "material/material.h"
#include "measure/btf.h"
#include "measure/maps.h"
#include "measure/plan.h"
#include "measure/relight.h"
#include "surface/height_field.h"
#include "surface/io/height_reader.h"
#include "surface/io/radiance_image.h"
#include "surface/prepare.h"

namespace gonio {

// How a file of heights or albedos is read; the service reads those of strangers in a process of their own.
using HeightReader = std::function<RawHeights(const std::string& path)>;
inline RawHeights read_trusted_heights(const std::string& path) {
    return read_heights(path);
}

// Where the relief comes from. A file is not opened before load_job().
struct FileSurface {
    std::string path;  // as the document says, resolved against JobOrigin::folder
    PrepareOptions options;
    HeightReader read = read_trusted_heights;
};
struct GridSurface {
    RawHeights grid;  // row 0 at y = 0
    PrepareOptions options;
};
struct GeneratedSurface {
    std::string name;  // "v_groove", ...
    std::function<HeightField()> generate;
};
using SurfaceSource = std::variant<FileSurface, GridSurface, GeneratedSurface>;

// Images registered to the stored surface that a number of the material is read from.
struct ParameterMap {
    size_t part = 0;                 // of material.lobes
    std::string parameter;           // as visit_parameters() calls it, or "weight"
    std::string field;               // where the document has it
    std::vector<std::string> paths;  // one, or one a channel
};
struct MaterialSource {
    Material material;  // complete but for the maps, in whose place stands some number that is allowed
    std::vector<ParameterMap> maps;
    HeightReader read = read_trusted_heights;
};

// Light from all around: a map that is not opened before load_job(), or the same radiance from everywhere.
using RadianceReader = std::function<RadianceImage(const std::string& path)>;
inline RadianceImage read_trusted_radiance(const std::string& path) {
    return read_radiance_image(path);
}
struct EnvironmentSource {
    std::vector<double> radiance;  // 1 or 3 values; empty if there is a file
    std::string path;
    EnvironmentLayout layout = EnvironmentLayout::automatic;
    double rotation_deg = 0, scale = 1;
    RadianceReader read = read_trusted_radiance;
};

// What is measured. A new kind is one alternative here and one file: measure_kind.h.
using MeasurePlan = std::variant<BrdfPlan, BtfPlan, MapsPlan, LightFieldPlan, RelightPlan>;

struct OutputRequest {
    std::string format;  // one of its kind's: "csv"
    std::string path;    // relative to the folder that the caller chooses
};

struct Job {
    SurfaceSource surface;
    MaterialSource material;
    MeasurePlan plan;
    std::vector<OutputRequest> outputs;
    BaseCurvature base;                                 // of what the surface stands on
    std::optional<EnvironmentSource> environment = {};  // of the kinds that take one
};

// What a document does not say about itself.
struct JobOrigin {
    std::string name = "gonio";  // outputs without a path are called <name>.<format>
    std::string folder = ".";    // relative input files are looked up here
};

// Throws Error whose field is the JSON pointer of the offending value. Opens no file.
Job parse_job(std::string_view text, const JobOrigin& origin);

// Only the "surface" section of a document; others are refused. For `gonio info` and `gonio ndf`.
SurfaceSource parse_surface_job(std::string_view text, const JobOrigin& origin);

// The JSON Schema (draft 2020-12) of the document.
std::string_view job_schema();

}  // namespace gonio
