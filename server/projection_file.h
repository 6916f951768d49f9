// Projections to spherical harmonics as files.
#pragma once
#include <string>
#include <vector>

#include "fitting/sh_projection.h"
#include "measure/report.h"

namespace gonio {

// "csv", "json", "npy", "exr".
const std::vector<std::string>& projection_formats();

// Whole or not at all; folders must be there. Each file carries the conventions, how it was fitted and the
// provenance; an .npy file as in npy_file.h: the head of the JSON file. Its elements have the fields value,
// se and bias. An OpenEXR file has a pixel a coefficient and a row a set of them, in channels Y, se.Y, bias.Y
// (of separate orders also order1.Y and so on), in single precision. Throws Error(io), Error(invalid_input)
// for an unknown format.
void write_projection(const HarmonicProjection& projection, const std::string& format,
                      const std::string& path);

// How it was fitted and how well, and a warning where isotropy was taken for granted and does not hold.
void add_to_report(const HarmonicProjection& projection, Report& report);

// "hsh order 8, per_light, 400 samples, cosine weighted".
std::string describe(const ProjectionPlan& plan);

}  // namespace gonio
