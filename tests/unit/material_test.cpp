// Facet reflectances: closed forms, then value, density and sample against each other.
#include <gtest/gtest.h>

#include <complex>
#include <numeric>
#include <random>

#include "base/error.h"
#include "material/coat.h"
#include "material/facet_brdf.h"
#include "material/fresnel.h"
#include "material/lobe_shape.h"
#include "material/metals.h"
#include "material/microfacet_distribution.h"
#include "surface/generate.h"
#include "surface/height_field.h"

namespace gonio {
namespace {

using Distribution = Microfacet::Distribution;

Vec3 direction(double theta_deg, double phi_deg) {
    return to_vector({theta_deg, phi_deg});
}

Lobe rough(Distribution distribution, double alpha_x, double alpha_y, double rotation_deg = 0,
           SpecularReflectance reflectance = {1.0, {}, {}}) {
    return Microfacet{distribution, alpha_x, alpha_y, rotation_deg, std::move(reflectance)};
}

// One facet of this gradient, as facet 0 of a cell.
HeightField tilted(double gx, double gy) {
    HeightField surface;
    surface.nx = surface.ny = 2;
    surface.pitch_x = surface.pitch_y = 1;
    surface.heights = {0, static_cast<float>(gx), 0, static_cast<float>(gx + gy)};
    return surface;
}
const HeightField flat = tilted(0, 0), slope = tilted(0.5, -0.75);

struct Named {
    std::string name;
    Material material;
};

// Every lobe, wide and narrow, and mixtures of them; all have a density.
std::vector<Named> all_materials() {
    const std::vector<std::string> y{"y"};
    std::vector<Named> list = {
        {"lambertian", {y, Lambertian{0.7}}},
        {"phong 5", {y, Phong{5.0, 0.8}}},
        {"phong 60", {y, Phong{60.0, 1.0}}},
        {"blinn_phong 5", {y, BlinnPhong{5.0, 0.8}}},
        {"blinn_phong 60", {y, BlinnPhong{60.0, 1.0}}},
        {"ggx 1", {y, rough(Distribution::ggx, 1, 1)}},
        {"ggx .3", {y, rough(Distribution::ggx, 0.3, 0.3)}},
        {"ggx .2 x .6", {y, rough(Distribution::ggx, 0.2, 0.6, 30)}},
        {"beckmann 1", {y, rough(Distribution::beckmann, 1, 1)}},
        {"beckmann .3", {y, rough(Distribution::beckmann, 0.3, 0.3)}},
        {"beckmann .6 x .2", {y, rough(Distribution::beckmann, 0.6, 0.2, -50)}},
        {"ggx .3 gold", {y, rough(Distribution::ggx, 0.3, 0.3, 0, {{}, 0.43, 2.455})}},
        {"coated", {y, CoatedDiffuse{1.5, 0.3, 0.8}}},
        {"coated white", {y, CoatedDiffuse{1.5, 0.5, 1.0}}},
    };
    Material mixture;
    mixture.channels = {"a", "b"};
    mixture.lobes = {{0.5, Lambertian{{0.8, 0.2}}},
                     {{0.3, 0.5}, rough(Distribution::ggx, 0.2, 0.4, 20)},
                     {0.2, CoatedDiffuse{1.8, 0.4, {0.1, 0.9}}}};
    list.push_back({"mixture", mixture});
    return list;
}

std::vector<double> f_of(const FacetBrdf& brdf, const Material& material, const Vec3& wi, const Vec3& wo) {
    std::vector<double> f(material.channels.size());
    brdf.eval(wi, wo, f);
    return f;
}

std::vector<Vec3> some_directions() {
    std::vector<Vec3> list;
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int k = 0; k < 40; ++k)
        list.push_back(direction(degrees(std::acos(uniform(random))), 360 * uniform(random)));
    return list;
}

// ---- Fresnel

TEST(Fresnel, NormalIncidenceAndLimits) {
    EXPECT_NEAR(fresnel_dielectric(1, 1.5), 0.04, 1e-15);
    EXPECT_NEAR(fresnel_conductor(1, 0.43, 2.455),
                (std::pow(0.57, 2) + 2.455 * 2.455) / (std::pow(1.43, 2) + 2.455 * 2.455), 1e-14);
    for (const double c : {1e-9, 0.01, 0.3, 1.0}) {
        EXPECT_NEAR(fresnel_dielectric(c, 1), 0, 1e-27) << c;
        EXPECT_NEAR(fresnel_conductor(c, 1, 0), 0, 1e-15) << c;
        // 1 - F = 4 cos / eta to first order for s, 4 / (eta cos) for p, while eta cos is large.
        if (c > 0.001) {
            EXPECT_NEAR(fresnel_dielectric(c, 1e6), 1 - 2e-6 * (c + 1 / c), 1e-7) << c;
        }
        EXPECT_LE(fresnel_conductor(c, 1e6, 1e6), 1);
    }
    EXPECT_NEAR(fresnel_dielectric(1e-9, 1.5), 1, 1e-7);
    EXPECT_NEAR(fresnel_conductor(1e-9, 0.43, 2.455), 1, 1e-7);
    EXPECT_EQ(fresnel_dielectric(0.5, 0.8), 1);  // beyond the critical angle
}

TEST(Fresnel, BrewsterAngleLeavesHalfOfTheOther) {
    for (const double eta : {1.33, 1.5, 2.4}) {
        const double cos_brewster = 1 / std::sqrt(1 + eta * eta),
                     s = (eta * eta - 1) / (eta * eta + 1);  // cos_inside = sin_brewster
        EXPECT_NEAR(fresnel_dielectric(cos_brewster, eta), s * s / 2, 1e-14);
    }
}

TEST(Fresnel, EqualsComplexAmplitudes) {
    for (const auto& [eta, k] :
         {std::pair{0.05, 3.6}, {1.07, 6.78}, {2.95, 2.93}, {1.5, 0.0}, {0.7, 0.0}, {1e-6, 1e3}})
        for (double c = 0.01; c <= 1; c += 0.03) {
            const std::complex<double> n(eta, k),
                inside = std::sqrt(n * n - (1 - c * c));  // n cos of the refracted
            const auto s = (c - inside) / (c + inside), p = (n * n * c - inside) / (n * n * c + inside);
            const double exact = (std::norm(s) + std::norm(p)) / 2;
            EXPECT_NEAR(fresnel_conductor(c, eta, k), exact, 1e-12) << eta << " " << k << " " << c;
            if (k == 0) {
                EXPECT_NEAR(fresnel_dielectric(c, eta), exact, 1e-12) << eta << " " << c;
            }
        }
}

TEST(Metals, AreThePublishedSamples) {
    const ComplexIndex gold = metal_index(Metal::au, 548.6), iron = metal_index(Metal::fe, 549),
                       aluminium = metal_index(Metal::al, 563.57);
    EXPECT_NEAR(gold.eta, 0.43, 1e-12);
    EXPECT_NEAR(gold.k, 2.455, 1e-12);
    EXPECT_NEAR(iron.eta, 2.95, 1e-12);
    EXPECT_NEAR(aluminium.eta, 1.0728, 1e-12);
    EXPECT_NEAR(aluminium.k, 6.7839, 1e-12);
    const ComplexIndex between = metal_index(Metal::cu, (548.6 + 582.1) / 2);
    EXPECT_NEAR(between.eta, (1.02 + 0.70) / 2, 1e-12);
    EXPECT_NEAR(between.k, (2.577 + 2.704) / 2, 1e-12);
    for (const double bad : {310.9, 837.5, std::nan("")})
        EXPECT_THROW(metal_index(Metal::ag, bad), Error) << bad;
}

TEST(Metals, HaveTheirColours) {
    const auto f0 = [](Metal metal) {
        std::array<double, 3> rgb{};
        for (size_t c = 0; c < 3; ++c)
            rgb[c] = fresnel_conductor(1, metal_index_rgb(metal)[c].eta, metal_index_rgb(metal)[c].k);
        return rgb;
    };
    for (const Metal metal : {Metal::au, Metal::cu}) {
        EXPECT_GT(f0(metal)[0], f0(metal)[1] + 0.1);
        EXPECT_GT(f0(metal)[1], f0(metal)[2] + 0.02);
    }
    for (const double f : f0(Metal::ag)) EXPECT_GT(f, 0.97);
    for (const double f : f0(Metal::al)) EXPECT_NEAR(f, 0.915, 0.012);
    for (const double f : f0(Metal::fe)) EXPECT_NEAR(f, 0.54, 0.05);
}

// ---- value

// What the facet itself sends straight back.
TEST(LobeShape, PeaksAreThoseOfTheFacet) {
    const HeightField plane = generate_plane(2, 2);
    const Vec3 up{0, 0, 1};
    const SpecularReflectance gold{{}, {0.2, 0.5, 1.3}, {3.0, 2.5, 1.9}}, half{0.5, {}, {}};
    Material mixture({"y"}, Lambertian{0.6});
    mixture.lobes.front().weight = 0.3;
    mixture.lobes.push_back({0.5, rough(Distribution::beckmann, 0.1, 0.4, 20, half)});
    for (const Material& material :
         {Material({"y"}, Lambertian{0.7}), Material({"y"}, Phong{30.0, 0.5}),
          Material({"y"}, BlinnPhong{0.0, 0.5}), Material({"y"}, BlinnPhong{80.0, 0.5}),
          Material({"y"}, rough(Distribution::ggx, 0.2, 0.2)),
          Material({"y"}, rough(Distribution::ggx, 1e-4, 1e-4)), mixture})
        EXPECT_NEAR(highest_peak(material) / f_of(FacetBrdf(material, plane, 0, 0, 0), material, up, up)[0],
                    1, 1e-6);
    // Means over channels of the index, and a base under its coat: within the tenth that this is for.
    const Material metal({"r", "g", "b"}, rough(Distribution::ggx, 0.3, 0.3, 0, gold)),
        coat({"y"}, CoatedDiffuse{1.5, 0.1, 0.8});
    double mean = 0;
    for (const double f : f_of(FacetBrdf(metal, plane, 0, 0, 0), metal, up, up)) mean += f / 3;
    EXPECT_NEAR(highest_peak(metal) / mean, 1, 0.1);
    EXPECT_NEAR(highest_peak(coat) / f_of(FacetBrdf(coat, plane, 0, 0, 0), coat, up, up)[0], 1, 0.3);
    EXPECT_TRUE(std::isinf(highest_peak({{"y"}, Mirror{half}})));
    EXPECT_EQ(highest_peak({{"y"}, Mirror{{0.0, {}, {}}}}), 0);
    // The narrowest of a map counts.
    Material mapped({"y"}, rough(Distribution::ggx, 0.3, 0.3));
    std::get<Microfacet>(mapped.lobes[0].lobe).alpha_x = Parameter::mapped(2, 2, {0.3f, 0.03f, 0.5f, 0.4f});
    EXPECT_NEAR(lobe_shapes(mapped)[0].width, std::sqrt(0.03 * 0.3), 1e-6);
}

TEST(FacetBrdf, IsReciprocal) {
    for (const auto& [name, material] : all_materials())
        for (const HeightField* surface : {&flat, &slope}) {
            const FacetBrdf brdf(material, *surface, 0, 0, 0);
            const std::vector<Vec3> list = some_directions();
            for (size_t k = 0; k + 1 < list.size(); ++k) {
                const auto there = f_of(brdf, material, list[k], list[k + 1]),
                           back = f_of(brdf, material, list[k + 1], list[k]);
                for (size_t c = 0; c < there.size(); ++c) {
                    EXPECT_NEAR(there[c], back[c], 1e-12 * there[c]) << name;
                    EXPECT_GE(there[c], 0) << name;
                }
                const bool above = dot(brdf.normal(), list[k]) > 0 && dot(brdf.normal(), list[k + 1]) > 0;
                if (!above) {
                    EXPECT_EQ(there[0], 0) << name;
                }
            }
        }
}

TEST(FacetBrdf, TangentStandsAboveItsDirection) {
    // Narrow across the tangent: of half vectors in the plane of normal and tangent f is larger than of those
    // across.
    const Material material({"y"}, rough(Distribution::ggx, 0.5, 0.05, 30));
    const FacetBrdf brdf(material, slope, 0, 0, 0);
    const double x = std::cos(radians(30)), y = std::sin(radians(30)), rise = 0.5 * x - 0.75 * y,
                 length = std::sqrt(1 + rise * rise);
    const Vec3 n = brdf.normal(), t{x / length, y / length, rise / length};
    EXPECT_NEAR(dot(n, t), 0, 1e-15);
    const Vec3 b{n.y * t.z - n.z * t.y, n.z * t.x - n.x * t.z, n.x * t.y - n.y * t.x};
    const auto retro = [&](const Vec3& side, double angle) {  // half vector = wi = wo
        const double c = std::cos(angle), s = std::sin(angle);
        const Vec3 w{n.x * c + side.x * s, n.y * c + side.y * s, n.z * c + side.z * s};
        return f_of(brdf, material, w, w)[0];
    };
    for (const double angle : {-0.3, 0.3}) {
        // D / (4 cos^2 (1 + 2 lambda)) with tan^2 / alpha^2 along the one axis
        const auto expected = [&](double alpha) {
            const double c = std::cos(angle), q = std::pow(std::sin(angle) / alpha, 2) + c * c,
                         lambda = (std::sqrt(1 + std::pow(alpha * std::tan(angle), 2)) - 1) / 2;
            return 1 / (pi * 0.5 * 0.05 * q * q) / (4 * c * c * (1 + 2 * lambda));
        };
        EXPECT_NEAR(retro(t, angle), expected(0.5), 1e-11 * expected(0.5));
        EXPECT_NEAR(retro(b, angle), expected(0.05), 1e-11 * expected(0.05));
    }
}

TEST(FacetBrdf, RotationByAQuarterSwapsTheAlphas) {
    for (const Distribution d : {Distribution::ggx, Distribution::beckmann}) {
        const Material a({"y"}, rough(d, 0.2, 0.6, 90)), b({"y"}, rough(d, 0.6, 0.2, 0));
        for (const Vec3& wi : some_directions())
            EXPECT_NEAR(f_of(FacetBrdf(a, flat, 0, 0, 0), a, wi, direction(30, 10))[0],
                        f_of(FacetBrdf(b, flat, 0, 0, 0), b, wi, direction(30, 10))[0], 1e-10);
    }
}

TEST(FacetBrdf, AMixtureIsTheSumOfItsParts) {
    const Named mixture = all_materials().back();
    for (const Vec3& wi : some_directions()) {
        const Vec3 wo = direction(35, 200);
        const auto whole = f_of(FacetBrdf(mixture.material, slope, 0, 0, 0), mixture.material, wi, wo);
        for (size_t c = 0; c < 2; ++c) {
            double sum = 0;
            for (const WeightedLobe& part : mixture.material.lobes) {
                const Material alone({"a", "b"}, part.lobe);
                sum += part.weight.at(c, 0, 0) * f_of(FacetBrdf(alone, slope, 0, 0, 0), alone, wi, wo)[c];
            }
            EXPECT_NEAR(whole[c], sum, 1e-14 + 1e-12 * sum);
        }
    }
}

TEST(FacetBrdf, MapsAreLookedUpInTheirCell) {
    Material material;
    material.channels = {"y"};
    material.lobes = {
        {Parameter::mapped(2, 2, {0, 0.25, 0.5, 1}),
         Phong{Parameter::mapped(2, 2, {1, 2, 3, 4}), Parameter::mapped(2, 2, {0.5f, 0.5f, 1, 0.5f})}}};
    const Vec3 w = direction(0, 0);
    EXPECT_EQ(f_of(FacetBrdf(material, flat, 0, 0, 0), material, w, w)[0], 0);
    EXPECT_NEAR(f_of(FacetBrdf(material, flat, 1, 0, 1), material, w, w)[0], 0.5 * 1 * 5 / (2 * pi), 1e-14);
    EXPECT_NEAR(f_of(FacetBrdf(material, flat, 0, 1, 1), material, w, w)[0], 1 * 0.5 * 6 / (2 * pi), 1e-14);
}

// ---- sample

// The map from random numbers to directions squeezes areas by the pdf, exactly: for lobes that one map
// samples.
TEST(FacetBrdf, PdfIsOneOverTheJacobianOfSample) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> uniform(0.02, 0.98);
    std::vector<Named> list = all_materials();
    list.push_back({"ggx 1e-4", {{"y"}, rough(Distribution::ggx, 1e-4, 1e-4)}});
    list.push_back({"beckmann 1e-3", {{"y"}, rough(Distribution::beckmann, 1e-3, 1e-3)}});
    for (const auto& [name, material] : list) {
        if (name.starts_with("coated") || name == "mixture") continue;
        const FacetBrdf brdf(material, slope, 0, 0, 0);
        int n = 0;
        for (int k = 0; k < 200; ++k) {
            const double u1 = uniform(random), u2 = uniform(random), step = 1e-5;
            const Vec3 wo = direction(80 * uniform(random), 360 * uniform(random));
            std::vector<double> weight(1);
            const auto at = [&](double a, double b) { return brdf.sample(wo, 0.5, a, b, weight); };
            const auto here = at(u1, u2), e = at(u1 + step, u2), w = at(u1 - step, u2),
                       north = at(u1, u2 + step), south = at(u1, u2 - step);
            if (!here || !e || !w || !north || !south) continue;
            const auto difference = [&](const Vec3& a, const Vec3& b) {
                return Vec3{(a.x - b.x) / (2 * step), (a.y - b.y) / (2 * step), (a.z - b.z) / (2 * step)};
            };
            const Vec3 d1 = difference(e->wi, w->wi), d2 = difference(north->wi, south->wi),
                       area = cross(d1, d2);
            EXPECT_NEAR(here->pdf * std::sqrt(dot(area, area)), 1, 2e-3) << name;
            EXPECT_NEAR(brdf.pdf(wo, here->wi), here->pdf, 1e-6 * here->pdf) << name;
            ++n;
        }
        EXPECT_GT(n, 100) << name;
    }
}

// Chi-square over 16 x 32 bins of equal solid angle, and one for what is lost below the facet. Wilson &
// Hilferty's normal deviate; 3.5 is exceeded by chance once in 100 runs of all these tests.
double chi_square_deviate(const FacetBrdf& brdf, size_t n_channels, const Vec3& wo, uint64_t seed) {
    constexpr int rows = 16, columns = 32, fine = 8, samples = 100000;
    const Vec3 n = brdf.normal();
    const Vec3 side = normalized(cross(n, {0.3, 0.9, 0.1})), across = cross(n, side);
    const auto world = [&](double z, double phi) {
        const double r = safe_sqrt(1 - z * z), x = r * std::cos(phi), y = r * std::sin(phi);
        return Vec3{side.x * x + across.x * y + n.x * z, side.y * x + across.y * y + n.y * z,
                    side.z * x + across.z * y + n.z * z};
    };
    std::vector<double> expected(rows * columns + 1, 0.0), observed(rows * columns + 1, 0.0);
    for (int r = 0; r < rows * fine; ++r)
        for (int c = 0; c < columns * fine; ++c) {
            const Vec3 wi = world((r + 0.5) / (rows * fine), 2 * pi * (c + 0.5) / (columns * fine));
            expected[r / fine * columns + c / fine] +=
                samples * brdf.pdf(wo, wi) * 2 * pi / (rows * fine * columns * fine);
        }
    expected.back() = std::max(0.0, samples - std::accumulate(expected.begin(), expected.end() - 1, 0.0));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<double> weight(n_channels);
    for (int k = 0; k < samples; ++k) {
        const double a = uniform(random), b = uniform(random), c = uniform(random);
        const auto sample = brdf.sample(wo, a, b, c, weight);
        if (!sample) {
            ++observed.back();
            continue;
        }
        double phi = std::atan2(dot(across, sample->wi), dot(side, sample->wi));
        if (phi < 0) phi += 2 * pi;
        const int row = std::clamp(static_cast<int>(dot(n, sample->wi) * rows), 0, rows - 1),
                  column = std::min(static_cast<int>(phi / (2 * pi) * columns), columns - 1);
        ++observed[row * columns + column];
    }
    // Bins in which few are expected are one.
    double chi_2 = 0, few_expected = 0, few_observed = 0;
    int degrees_of_freedom = -1;
    const auto add = [&](double e, double o) {
        chi_2 += (o - e) * (o - e) / e;
        ++degrees_of_freedom;
    };
    for (size_t k = 0; k < expected.size(); ++k)
        if (expected[k] < 8)
            few_expected += expected[k], few_observed += observed[k];
        else
            add(expected[k], observed[k]);
    if (few_expected > 8)
        add(few_expected, few_observed);
    else
        EXPECT_LE(few_observed, few_expected + 40);
    const double spread = 2.0 / (9.0 * degrees_of_freedom);
    return (std::cbrt(chi_2 / degrees_of_freedom) - (1 - spread)) / std::sqrt(spread);
}

TEST(FacetBrdf, SamplesFollowThePdf) {
    for (const auto& [name, material] : all_materials()) {
        const FacetBrdf brdf(material, slope, 0, 0, 0);
        for (const Vec3& wo : {direction(10, 40), direction(60, 200)})
            EXPECT_LT(chi_square_deviate(brdf, material.channels.size(), wo, 17), 3.5) << name;
    }
}

// Share of the light from wo that leaves, per channel: the mean weight over a lattice of random numbers.
std::vector<double> directional_albedo(const Material& material, const Vec3& wo, int n = 256) {
    const FacetBrdf brdf(material, flat, 0, 0, 0);
    std::vector<double> sum(material.channels.size()), weight(material.channels.size());
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const double u_lobe = fractional_part((i * n + j) * 0.6180339887498949);
            if (!brdf.sample(wo, u_lobe, (i + 0.5) / n, (j + 0.5) / n, weight)) continue;
            for (size_t c = 0; c < sum.size(); ++c) sum[c] += weight[c] / n / n;
        }
    return sum;
}

TEST(Energy, IsNotCreated) {
    for (const auto& [name, material] : all_materials())
        for (const double theta_deg : {0.0, 30.0, 60.0, 80.0, 89.0})
            for (const double albedo : directional_albedo(material, direction(theta_deg, 25), 128))
                EXPECT_LE(albedo, 1.0005) << name << " at " << theta_deg;
}

// The same integral without sample() and pdf(): over the hemisphere, evenly in projected solid angle.
TEST(Energy, OfSamplesIsThatOfTheValues) {
    for (const auto& [name, material] : all_materials()) {
        const Vec3 wo = direction(40, 25);
        const FacetBrdf brdf(material, flat, 0, 0, 0);
        const auto sampled = directional_albedo(material, wo);
        std::vector<double> sum(material.channels.size());
        constexpr int n = 300;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) {
                const double z = std::sqrt((i + 0.5) / n);
                const auto f =
                    f_of(brdf, material, direction(degrees(std::acos(z)), 360 * (j + 0.5) / n), wo);
                for (size_t c = 0; c < f.size(); ++c) sum[c] += pi * f[c] / n / n;
            }
        for (size_t c = 0; c < sum.size(); ++c) EXPECT_NEAR(sampled[c], sum[c], 2e-3 * sum[c]) << name;
    }
}

TEST(Energy, ClosedForms) {
    // GGX, alpha = 1, F = 1, normal incidence, height-correlated Smith.
    const Material ggx({"y"}, rough(Distribution::ggx, 1, 1));
    EXPECT_NEAR(directional_albedo(ggx, direction(0, 0), 512)[0], 1 - std::log(2.0), 2e-4);
    for (const double n : {0.0, 3.0, 100.0}) {
        EXPECT_NEAR(directional_albedo({{"y"}, Phong{n, 0.9}}, direction(0, 0))[0], 0.9, 1e-3) << n;
        EXPECT_NEAR(directional_albedo({{"y"}, BlinnPhong{n, 0.9}}, direction(0, 0))[0], 0.9, 2e-3) << n;
    }
    // Lobes so narrow that nothing is masked reflect F.
    for (const Distribution d : {Distribution::ggx, Distribution::beckmann})
        for (const double theta_deg : {0.0, 50.0}) {
            const Material gold({"y"}, rough(d, 1e-4, 1e-4, 0, {{}, 0.43, 2.455}));
            EXPECT_NEAR(directional_albedo(gold, direction(theta_deg, 0))[0],
                        fresnel_conductor(std::cos(radians(theta_deg)), 0.43, 2.455), 1e-4);
        }
}

// Nothing absorbs: over a white base all light comes back, and an interface without contrast is none.
TEST(Coat, IsConservative) {
    for (const double eta : {1.0, 1.3, 1.5, 2.0, 3.0})
        for (const double theta_deg : {0.0, 45.0, 70.0, 85.0})
            EXPECT_NEAR(
                directional_albedo({{"y"}, CoatedDiffuse{eta, 1e-4, 1.0}}, direction(theta_deg, 0))[0], 1,
                2e-3)
                << eta << " " << theta_deg;
    const Material bare({"y"}, CoatedDiffuse{1.0, 0.4, 0.6});
    for (const Vec3& wi : some_directions())
        EXPECT_NEAR(f_of(FacetBrdf(bare, flat, 0, 0, 0), bare, wi, direction(50, 3))[0], 0.6 / pi, 1e-12);
    // Of a black base the coat alone is seen.
    const Material black({"y"}, CoatedDiffuse{1.5, 0.3, 0.0});
    const Vec3 w = direction(0, 0);
    EXPECT_NEAR(f_of(FacetBrdf(black, flat, 0, 0, 0), black, w, w)[0], 0.04 / (4 * pi * 0.09), 1e-12);
    // The hostile index lets next to nothing through.
    const Material metal_like({"y"}, CoatedDiffuse{1e6, 0.3, 1.0});
    EXPECT_NEAR(f_of(FacetBrdf(metal_like, flat, 0, 0, 0), metal_like, w, w)[0], 1 / (4 * pi * 0.09), 1e-5);
}

// Light between a gray base and the coat, bounce by bounce. Of a smooth interface of index 1.5, diffuse light
// inside is reflected to 59.6 % (Walsh's formula and reciprocity).
TEST(Coat, GrayBasesBounceToAllOrders) {
    EXPECT_NEAR(1 - mean_coat_transmittance(1.5, 1e-6) / (1.5 * 1.5), 0.596, 2e-3);
    for (const double eta : {1.3, 2.2})
        for (const double albedo : {0.2, 0.7}) {
            const Material gray({"y"}, CoatedDiffuse{eta, 0.3, albedo}),
                black({"y"}, CoatedDiffuse{eta, 0.3, 0.0});
            const Vec3 wi = direction(40, 10), wo = direction(60, 120);
            const double inside = 1 - mean_coat_transmittance(eta, 0.3) / (eta * eta);
            double f = f_of(FacetBrdf(black, flat, 0, 0, 0), black, wi, wo)[0];
            double order =
                coat_transmittance(eta, 0.3, wi.z) * coat_transmittance(eta, 0.3, wo.z) / (pi * eta * eta);
            for (int k = 0; k < 200; ++k, order *= inside) {
                order *= albedo;
                f += order;
            }
            EXPECT_NEAR(f_of(FacetBrdf(gray, flat, 0, 0, 0), gray, wi, wo)[0], f, 1e-10 * f)
                << eta << " " << albedo;
        }
}

TEST(Coat, TableIsTheMeanOverVisibleNormals) {
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int k = 0; k < 60; ++k) {
        const double eta = 1 + 2 * uniform(random), alpha = 0.02 + 0.98 * uniform(random),
                     z = 0.02 + 0.98 * uniform(random);
        const MicrofacetDistribution normals{Distribution::ggx, alpha, alpha};
        const Vec3 w{std::sqrt(1 - z * z), 0, z};
        double mean = 0;
        constexpr int n = 64;
        for (int i = 0; i < n * n; ++i) {
            const Vec3 h = normals.sample_visible(w, (i / n + 0.5) / n, (i % n + 0.5) / n);
            mean += (1 - fresnel_dielectric(std::min(1.0, dot(w, h)), eta)) / (n * n);
        }
        EXPECT_NEAR(coat_transmittance(eta, alpha, z), mean, 0.01) << eta << " " << alpha << " " << z;
    }
    for (const double eta : {1.0, 1.5, 2.7}) {
        double mean = 0;
        for (int i = 0; i < 20000; ++i) {
            const double z = (i + 0.5) / 20000;
            mean += 2 * z * coat_transmittance(eta, 0.37, z) / 20000;
        }
        EXPECT_NEAR(mean_coat_transmittance(eta, 0.37), mean, 1e-6);
    }
}

// The corners of what is allowed, and grazing directions: finite, and no light made.
TEST(FacetBrdf, HostileNumbers) {
    std::vector<Material> list;
    for (const double alpha : {1e-6, 1e-4, 1.0})
        for (const Distribution d : {Distribution::ggx, Distribution::beckmann}) {
            list.push_back({{"y"}, rough(d, alpha, 1)});
            list.push_back({{"y"}, rough(d, alpha, alpha, 17, {{}, 1e-6, 1e6})});
            list.push_back({{"y"}, rough(d, alpha, alpha, 17, {{}, 1e6, 0.0})});
        }
    for (const double alpha : {1e-6, 1.0})
        for (const double eta : {1.0, 1e6}) list.push_back({{"y"}, CoatedDiffuse{eta, alpha, 1.0}});
    for (const double exponent : {0.0, 1e6}) {
        list.push_back({{"y"}, Phong{exponent, 1.0}});
        list.push_back({{"y"}, BlinnPhong{exponent, 1.0}});
    }
    list.push_back({{"y"}, Mirror{{{}, 1.0, 0.0}}});
    list.push_back({{"y"}, Lambertian{0.0}});
    for (size_t m = 0; m < list.size(); ++m) {
        const FacetBrdf brdf(list[m], flat, 0, 0, 0);
        for (const double theta_deg : {0.0, 1e-6, 45.0, 89.0, 89.9999}) {
            const Vec3 wo = direction(theta_deg, 33);
            for (const Vec3& wi : {wo, direction(theta_deg, 213), direction(89.9999, 100)}) {
                const double f = f_of(brdf, list[m], wi, wo)[0], density = brdf.pdf(wo, wi);
                EXPECT_TRUE(std::isfinite(f) && f >= 0) << m << " at " << theta_deg << ": " << f;
                EXPECT_TRUE(std::isfinite(density) && density >= 0)
                    << m << " at " << theta_deg << ": " << density;
            }
            const double albedo = directional_albedo(list[m], wo, 40)[0];
            EXPECT_TRUE(albedo >= 0 && albedo <= 1.002) << m << " at " << theta_deg << ": " << albedo;
        }
    }
}

TEST(FacetBrdf, MirrorsHaveNoDensity) {
    const Material gold({"y"}, Mirror{{{}, 0.43, 2.455}});
    const FacetBrdf brdf(gold, slope, 0, 0, 0);
    EXPECT_TRUE(brdf.has_delta());
    EXPECT_FALSE(brdf.has_density());
    const Vec3 wo = direction(20, 100), n = brdf.normal();
    std::vector<double> weight(1);
    const auto sample = brdf.sample(wo, 0.3, 0.4, 0.5, weight);
    ASSERT_TRUE(sample && sample->is_delta);
    EXPECT_NEAR(dot(n, sample->wi), dot(n, wo), 1e-15);
    const Vec3 sum{sample->wi.x + wo.x, sample->wi.y + wo.y, sample->wi.z + wo.z}, off = cross(sum, n);
    EXPECT_NEAR(dot(off, off), 0, 1e-30);
    EXPECT_NEAR(weight[0], fresnel_conductor(dot(n, wo), 0.43, 2.455), 1e-15);
    EXPECT_EQ(brdf.pdf(wo, sample->wi), 0);
    EXPECT_EQ(f_of(brdf, gold, sample->wi, wo)[0], 0);
}

// Half mirror, half paint: what leaves is the mean of both, whatever the odds of choosing one.
TEST(FacetBrdf, MirrorsMixWithOthers) {
    Material material;
    material.channels = {"a", "b"};
    material.lobes = {{0.5, Mirror{{{0.9, 0.3}, {}, {}}}}, {0.5, Lambertian{{0.2, 0.8}}}};
    const auto albedo = directional_albedo(material, direction(40, 0));
    EXPECT_NEAR(albedo[0], 0.55, 1e-3);
    EXPECT_NEAR(albedo[1], 0.55, 1e-3);
    const FacetBrdf brdf(material, flat, 0, 0, 0);
    EXPECT_TRUE(brdf.has_delta() && brdf.has_density());
    EXPECT_NEAR(f_of(brdf, material, direction(40, 180), direction(40, 0))[1], 0.4 / pi, 1e-14);
}

// ---- parameters

template <class Function>
Error error_of(Function&& function) {
    try {
        function();
    } catch (const Error& error) {
        return error;
    }
    return {ErrorCode::internal, "nothing was thrown", "", ""};
}

TEST(Validation, NamesTheParameter) {
    const auto field = [](const Lobe& lobe) {
        return error_of([&] { validate({{"r", "g", "b"}, lobe}, 2, 2); }).field();
    };
    const double nan = std::nan("");
    for (const double alpha : {0.0, -0.1, 1.01, 1e-7, nan})
        EXPECT_EQ(field(rough(Distribution::ggx, alpha, 0.5)), "/material/alpha_x") << alpha;
    for (const double alpha : {1e-6, 1e-4, 1.0})
        EXPECT_NO_THROW(validate({{"y"}, rough(Distribution::ggx, alpha, 1)}, 2, 2));
    EXPECT_EQ(field(rough(Distribution::ggx, 0.5, 2)), "/material/alpha_y");
    EXPECT_EQ(field(Microfacet{Distribution::ggx, {0.1, 0.2, 0.3}, 0.1, 0.0, {1.0, {}, {}}}),
              "/material/alpha_x");
    EXPECT_EQ(field(Phong{-1.0, 0.5}), "/material/exponent");
    EXPECT_EQ(field(Phong{1.0, 1.5}), "/material/albedo");
    EXPECT_EQ(field(CoatedDiffuse{0.9, 0.3, 0.5}), "/material/eta");
    EXPECT_EQ(field(CoatedDiffuse{2e6, 0.3, 0.5}), "/material/eta");
    for (const double eta : {1.0, 1e6})
        EXPECT_NO_THROW(validate({{"y"}, CoatedDiffuse{eta, 0.3, 0.5}}, 2, 2));
    EXPECT_EQ(field(Mirror{{{0.5, 0.5}, {}, {}}}), "/material/reflectance");
    EXPECT_EQ(field(Mirror{{{}, 0.0, 1.0}}), "/material/eta");
    EXPECT_EQ(field(Mirror{{{}, 1.0, {}}}), "/material/k");
    EXPECT_EQ(field(Phong{Parameter::mapped(2, 2, {1, 2, 3, -1}), 0.5}),
              "/material/exponent, column 1, row 1");
    EXPECT_EQ(field(Phong{Parameter::mapped(2, 1, {1, 2}), 0.5}), "/material/exponent");
    Material mixture;
    mixture.channels = {"y"};
    mixture.lobes = {{0.7, Lambertian{0.5}}, {0.4, Mirror{{1.0, {}, {}}}}};
    EXPECT_EQ(error_of([&] { validate(mixture, 2, 2); }).field(), "/material/parts");
    mixture.lobes[1].weight = Parameter::mapped(2, 2, {0.3f, 0.3f, 0.3f, 0.31f});
    EXPECT_EQ(error_of([&] { validate(mixture, 2, 2); }).field(), "/material/parts");
    mixture.lobes[1].weight = 1.1;
    EXPECT_EQ(error_of([&] { validate(mixture, 2, 2); }).field(), "/material/parts/1/weight");
}

TEST(Simplified, LambertiansBecomeOne) {
    Material mixture;
    mixture.channels = {"a", "b"};
    mixture.lobes = {{0.5, Lambertian{{0.8, 0.4}}},
                     {Parameter::mapped(1, 2, {0.5f, 0.25f}), Lambertian{0.4}}};
    ASSERT_FALSE(pure_lambertian(mixture));
    const Material kept = simplified(mixture);
    const Lambertian* one = pure_lambertian(kept);
    ASSERT_TRUE(one);
    EXPECT_NEAR(one->albedo.at(0, 0, 0), 0.6, 1e-6);
    EXPECT_NEAR(one->albedo.at(1, 0, 1), 0.3, 1e-6);
    mixture.lobes.push_back({0.0, Mirror{{1.0, {}, {}}}});
    EXPECT_TRUE(pure_lambertian(simplified(mixture)));
    // Beside others the parts keep their share.
    mixture.lobes = {{0.2, Lambertian{0.8}}, {0.5, Phong{8.0, 0.5}}, {0.3, Lambertian{0.3}}};
    const Material two = simplified(mixture);
    ASSERT_EQ(two.lobes.size(), 2u);
    EXPECT_NO_THROW(validate(two, 1, 1));
    for (const Vec3& wi : some_directions())
        EXPECT_NEAR(f_of(FacetBrdf(two, flat, 0, 0, 0), two, wi, direction(20, 0))[1],
                    f_of(FacetBrdf(mixture, flat, 0, 0, 0), mixture, wi, direction(20, 0))[1], 1e-14);
}

}  // namespace
}  // namespace gonio
