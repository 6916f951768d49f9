// Room temperature, out of refractiveindex.info (public domain, CC0 1.0):
// Ag, Au, Cu: P. B. Johnson, R. W. Christy, "Optical constants of the noble metals", Phys. Rev. B 6, 4370
// (1972). Fe: P. B. Johnson, R. W. Christy, "Optical constants of transition metals: Ti, V, Cr, Mn, Fe, Co,
// Ni, and Pd", Phys. Rev. B 9, 5056 (1974). Al: A. D. Rakic, "Algorithm for the determination of intrinsic
// optical constants of metal films: application to aluminum", Appl. Opt. 34, 4755 (1995).
#include "material/metals.h"

#include <algorithm>
#include <span>

#include "base/error.h"
#include "base/text.h"

namespace gonio {
namespace {

struct Sample {
    double wavelength_nm, eta, k;
};

constexpr Sample ag[] = {
    {310.7, 1.13, 0.616}, {320.4, 0.81, 0.392}, {331.5, 0.17, 0.829}, {342.5, 0.14, 1.142},
    {354.2, 0.1, 1.419},  {367.9, 0.07, 1.657}, {381.5, 0.05, 1.864}, {397.4, 0.05, 2.07},
    {413.3, 0.05, 2.275}, {430.5, 0.04, 2.462}, {450.9, 0.04, 2.657}, {471.4, 0.05, 2.869},
    {495.9, 0.05, 3.093}, {520.9, 0.05, 3.324}, {548.6, 0.06, 3.586}, {582.1, 0.05, 3.858},
    {616.8, 0.06, 4.152}, {659.5, 0.05, 4.483}, {704.5, 0.04, 4.838}, {756, 0.03, 5.242},
    {821.1, 0.04, 5.727}, {892, 0.04, 6.312}};
constexpr Sample al[] = {{309.96, 0.28003, 3.7081}, {326.28, 0.31474, 3.9165}, {364.66, 0.39877, 4.3957},
                         {413.28, 0.52135, 5.0008}, {442.8, 0.6079, 5.3676},   {476.87, 0.7278, 5.7781},
                         {516.6, 0.8734, 6.2418},   {563.57, 1.0728, 6.7839},  {619.93, 1.366, 7.4052},
                         {652.25, 1.5724, 7.7354},  {688.81, 1.8301, 8.0601},  {729.32, 2.1606, 8.3565},
                         {774.91, 2.6154, 8.4914},  {794.78, 2.7675, 8.3866},  {815.69, 2.7668, 8.2573},
                         {837.74, 2.6945, 8.1878}};
constexpr Sample au[] = {
    {310.7, 1.53, 1.893}, {320.4, 1.54, 1.898}, {331.5, 1.48, 1.883}, {342.5, 1.48, 1.871},
    {354.2, 1.5, 1.866},  {367.9, 1.48, 1.895}, {381.5, 1.46, 1.933}, {397.4, 1.47, 1.952},
    {413.3, 1.46, 1.958}, {430.5, 1.45, 1.948}, {450.9, 1.38, 1.914}, {471.4, 1.31, 1.849},
    {495.9, 1.04, 1.833}, {520.9, 0.62, 2.081}, {548.6, 0.43, 2.455}, {582.1, 0.29, 2.863},
    {616.8, 0.21, 3.272}, {659.5, 0.14, 3.697}, {704.5, 0.13, 4.103}, {756, 0.14, 4.542},
    {821.1, 0.16, 5.083}, {892, 0.17, 5.663}};
constexpr Sample cu[] = {
    {310.7, 1.38, 1.729}, {320.4, 1.38, 1.783}, {331.5, 1.34, 1.821}, {342.5, 1.36, 1.864},
    {354.2, 1.37, 1.916}, {367.9, 1.36, 1.975}, {381.5, 1.33, 2.045}, {397.4, 1.32, 2.116},
    {413.3, 1.28, 2.207}, {430.5, 1.25, 2.305}, {450.9, 1.24, 2.397}, {471.4, 1.25, 2.483},
    {495.9, 1.22, 2.564}, {520.9, 1.18, 2.608}, {548.6, 1.02, 2.577}, {582.1, 0.7, 2.704},
    {616.8, 0.3, 3.205},  {659.5, 0.22, 3.747}, {704.5, 0.21, 4.205}, {756, 0.24, 4.665},
    {821.1, 0.26, 5.18},  {892, 0.3, 5.768}};
constexpr Sample fe[] = {{311, 1.69, 2.06}, {320, 1.74, 2.12}, {332, 1.78, 2.19}, {342, 1.85, 2.27},
                         {354, 1.93, 2.35}, {368, 2.02, 2.43}, {381, 2.12, 2.5},  {397, 2.24, 2.58},
                         {413, 2.35, 2.65}, {431, 2.48, 2.71}, {451, 2.59, 2.77}, {471, 2.67, 2.82},
                         {496, 2.74, 2.88}, {521, 2.86, 2.91}, {549, 2.95, 2.93}, {582, 2.94, 2.99},
                         {617, 2.88, 3.05}, {659, 2.92, 3.1},  {704, 2.86, 3.19}, {756, 2.87, 3.28},
                         {821, 2.94, 3.39}, {892, 2.96, 3.56}};

std::span<const Sample> samples_of(Metal metal) {
    switch (metal) {
        case Metal::ag:
            return ag;
        case Metal::al:
            return al;
        case Metal::au:
            return au;
        case Metal::cu:
            return cu;
        default:
            return fe;
    }
}

}  // namespace

ComplexIndex metal_index(Metal metal, double wavelength_nm) {
    const std::span<const Sample> samples = samples_of(metal);
    if (!(wavelength_nm >= shortest_metal_nm && wavelength_nm <= longest_metal_nm))
        throw Error(ErrorCode::invalid_input, "wavelength_nm", number_text(wavelength_nm),
                    "the tables of metals go from " + number_text(shortest_metal_nm) + " to " +
                        number_text(longest_metal_nm) + " nm");
    const auto above = std::upper_bound(samples.begin() + 1, samples.end() - 1, wavelength_nm,
                                        [](double w, const Sample& s) { return w < s.wavelength_nm; });
    const Sample &b = *above, &a = *(above - 1);
    const double t = (wavelength_nm - a.wavelength_nm) / (b.wavelength_nm - a.wavelength_nm);
    return {a.eta + t * (b.eta - a.eta), a.k + t * (b.k - a.k)};
}

std::array<ComplexIndex, 3> metal_index_rgb(Metal metal) {
    std::array<ComplexIndex, 3> rgb{};
    for (size_t c = 0; c < 3; ++c)
        for (int nm = 0; nm < 100; ++nm) {
            const ComplexIndex index = metal_index(metal, 600 - 100.0 * static_cast<double>(c) + nm + 0.5);
            rgb[c].eta += index.eta / 100;
            rgb[c].k += index.k / 100;
        }
    return rgb;
}

}  // namespace gonio
