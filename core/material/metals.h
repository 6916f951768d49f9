// Complex refractive indices eta + i k of metals over the visible; metals.cpp names their sources.
#pragma once
#include <array>

namespace gonio {

enum class Metal { ag, al, au, cu, fe };
inline constexpr std::array<const char*, 5> metal_names = {"Ag", "Al", "Au", "Cu", "Fe"};  // in that order

struct ComplexIndex {
    double eta = 0, k = 0;
};

inline constexpr double shortest_metal_nm = 311, longest_metal_nm = 837;

// At a wavelength in vacuum, linear between the published samples (15 to 70 nm apart). Throws Error outside
// [311, 837] nm.
ComplexIndex metal_index(Metal metal, double wavelength_nm);

// For channels r, g, b: the means over 600-700, 500-600 and 400-500 nm. A plain choice of three bands, not a
// colorimetric one: for colours as an observer sees them measure a spectrum and weigh it.
std::array<ComplexIndex, 3> metal_index_rgb(Metal metal);

}  // namespace gonio
