// The NDF of facets: formulas against reference tables, fits against the Cramer-Rao bound and closed forms.
#include "fitting/ndf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "fitting/fit_slopes.h"
#include "surface/generate.h"
#include "surface/io/height_reader.h"
#include "surface/prepare.h"

namespace gonio {
namespace {

// Entries of a reference file (by value: a range-for over a member of a temporary would outlive it).
nlohmann::json reference(const std::string& name) {
    std::ifstream in(GONIO_TEST_DATA "/validation/data/" + name + ".json");
    return nlohmann::json::parse(in).at("entries");
}

NdfModel model_named(const std::string& name) {
    return name == "ggx" ? NdfModel::ggx : NdfModel::beckmann;
}

// Slopes of n independent facets, drawn by inverting the CDF (ndf_value is checked against tables of its
// own).
std::vector<Gradient> draw(const NdfShape& shape, int n, uint64_t seed) {
    std::vector<Gradient> slopes;
    slopes.reserve(n);
    const double c = std::cos(shape.rotation), s = std::sin(shape.rotation);
    for (int k = 0; k < n; ++k) {
        const auto words = random_words(seed, 0, k);
        const double u = (words[0] + 0.5) * 0x1p-32, phi = 2 * pi * uniform_double(words[1]);
        const double r = std::tan(ndf_inverse_cdf(shape.model, 1, u));
        const double x = shape.alpha_x * r * std::cos(phi), y = shape.alpha_y * r * std::sin(phi);
        slopes.push_back({c * x - s * y, s * x + c * y});
    }
    return slopes;
}

// fits: beckmann isotropic, beckmann anisotropic, ggx isotropic, ggx anisotropic
int fit_index(NdfModel model, bool isotropic) {
    return (model == NdfModel::ggx ? 2 : 0) + (isotropic ? 0 : 1);
}

TEST(NdfModels, AgreeWithTheReferenceTables) {
    int n = 0;
    for (const std::string name : {"ndf_tables", "ndf_tables_b"}) {
        for (const auto& e : reference(name)) {
            const NdfShape shape{model_named(e["ndf"]), e["alpha_x"], e["alpha_y"], 0};
            const Vec3 m = to_vector({e["wm"][0], e["wm"][1]});
            const double expected = e["D"];
            EXPECT_NEAR(ndf_value(shape, m), expected, 1e-10 * expected + 1e-300) << e;
            ++n;
        }
    }
    EXPECT_EQ(n, 162);
}

TEST(NdfModels, InverseCdfsAgreeWithTheReference) {
    int n = 0;
    for (const std::string name : {"ndf_inverse_cdf", "ndf_inverse_cdf_b"}) {
        for (const auto& e : reference(name)) {
            if (e["ndf"] != "beckmann" && e["ndf"] != "ggx") continue;
            const double theta = ndf_inverse_cdf(model_named(e["ndf"]), e["parameter"], e["u"]);
            EXPECT_NEAR(degrees(theta), e["theta_m_deg"].get<double>(), 1e-9) << e;
            ++n;
        }
    }
    EXPECT_EQ(n, 28);
}

TEST(NdfModels, RotationTurnsTheAxes) {
    for (const NdfModel model : {NdfModel::beckmann, NdfModel::ggx}) {
        const NdfShape straight{model, 0.2, 0.5, 0}, turned{model, 0.2, 0.5, radians(30)};
        EXPECT_NEAR(ndf_value(straight, to_vector({25, 10})), ndf_value(turned, to_vector({25, 40})), 1e-12);
    }
}

TEST(NdfModels, ProjectedAreaIsOne) {
    for (const NdfModel model : {NdfModel::beckmann, NdfModel::ggx}) {
        for (const double alpha_y : {0.1, 0.6}) {
            const NdfShape shape{model, 0.3, alpha_y, 0.4};
            // Midpoints in sin^2(theta) and phi: cos(theta) d(omega) = d(sin^2 theta) d(phi) / 2.
            const int n = 1500;
            double sum = 0;
            for (int a = 0; a < n; ++a)
                for (int b = 0; b < n / 5; ++b) {
                    const double s2 = (a + 0.5) / n, phi = 2 * pi * (b + 0.5) / (n / 5);
                    const double s = std::sqrt(s2);
                    sum += ndf_value(shape, {s * std::cos(phi), s * std::sin(phi), std::sqrt(1 - s2)});
                }
            EXPECT_NEAR(sum * pi / (static_cast<double>(n) * (n / 5)), 1, 2e-4);
        }
    }
}

TEST(NdfFitIndependent, SolverReachesTheClosedForms) {
    const auto slopes = draw({NdfModel::ggx, 0.3, 0.15, radians(20)}, 5000, 3);
    double xx = 0, xy = 0, yy = 0;
    for (const Gradient& g : slopes) xx += g.x * g.x / 5000, xy += g.x * g.y / 5000, yy += g.y * g.y / 5000;
    const auto fits = fit_ndf(slopes);
    // Beckmann: alpha^2 = mean tan^2, and 2 C = R diag(alpha^2) R^T.
    EXPECT_NEAR(fits[0].alpha, std::sqrt(xx + yy), 1e-7);
    const double l_mean = xx + yy, l_half = std::hypot(xx - yy, 2 * xy);
    EXPECT_NEAR(fits[1].alpha_x, std::sqrt(l_mean + l_half), 1e-7);
    EXPECT_NEAR(fits[1].alpha_y, std::sqrt(l_mean - l_half), 1e-7);
    EXPECT_NEAR(fits[1].rotation_deg, degrees(0.5 * std::atan2(2 * xy, xx - yy)), 1e-5);
    // GGX: mean of alpha^2 / (alpha^2 + tan^2) = 1/2.
    double share = 0;
    for (const Gradient& g : slopes) {
        const double a2 = fits[2].alpha * fits[2].alpha;
        share += a2 / (a2 + g.x * g.x + g.y * g.y) / 5000;
    }
    EXPECT_NEAR(share, 0.5, 1e-8);
    for (const NdfFit& fit : fits) EXPECT_TRUE(fit.converged) << fit.message;
}

TEST(NdfFitIndependent, StandardErrorsAreTheCramerRaoBound) {
    int n_checked = 0;
    for (const auto& e : reference("ndf_fit_crb")) {
        const int n = e["n"];
        if (n > 70000) continue;
        ++n_checked;
        const auto beckmann = fit_ndf(draw({NdfModel::beckmann, 0.4, 0.4, 0}, n, 11));
        const auto ggx = fit_ndf(draw({NdfModel::ggx, 0.4, 0.4, 0}, n, 12));
        EXPECT_NEAR(beckmann[0].se_alpha / beckmann[0].alpha, e["beckmann_iso_rel_std_alpha"].get<double>(),
                    1e-9);
        EXPECT_NEAR(beckmann[1].se_alpha_x / beckmann[1].alpha_x,
                    e["beckmann_aniso_rel_std_each"].get<double>(), 1e-9);
        EXPECT_NEAR(ggx[2].se_alpha / ggx[2].alpha, e["ggx_iso_rel_std_alpha"].get<double>(), 1e-9);
        EXPECT_NEAR(ggx[3].se_alpha_y / ggx[3].alpha_y, e["ggx_aniso_rel_std_each"].get<double>(), 1e-9);
        EXPECT_NEAR(beckmann[0].alpha, 0.4, 3 * 0.4 * e["beckmann_iso_rel_std_alpha"].get<double>());
        EXPECT_NEAR(ggx[2].alpha, 0.4, 3 * 0.4 * e["ggx_iso_rel_std_alpha"].get<double>());
    }
    EXPECT_EQ(n_checked, 4);
}

// Pulls of every parameter over repetitions: rms 1 (its own error with 200 pulls is 5 %), mean 0.
TEST(NdfFitIndependent, StandardErrorsAreHonest) {
    for (const NdfModel model : {NdfModel::beckmann, NdfModel::ggx}) {
        const NdfShape shape{model, 0.25, 0.4, radians(-25)};
        double sums[4] = {}, squares[4] = {};
        const int repetitions = 200;
        for (int r = 0; r < repetitions; ++r) {
            const auto fits = fit_ndf(draw(shape, 1000, 100 + r));
            const NdfFit& fit = fits[fit_index(model, false)];
            ASSERT_TRUE(fit.converged) << fit.message;
            const double pulls[] = {(fit.alpha_x - 0.25) / fit.se_alpha_x,
                                    (fit.alpha_y - 0.4) / fit.se_alpha_y,
                                    (fit.rotation_deg + 25) / fit.se_rotation_deg,
                                    (fit.alpha - std::sqrt(0.25 * 0.4)) / fit.se_alpha};
            for (int k = 0; k < 4; ++k) sums[k] += pulls[k], squares[k] += pulls[k] * pulls[k];
        }
        for (int k = 0; k < 4; ++k) {
            const double rms = std::sqrt(squares[k] / repetitions);
            EXPECT_GT(rms, 0.85) << name_of(model) << " " << k;
            EXPECT_LT(rms, 1.15) << name_of(model) << " " << k;
            EXPECT_LT(std::abs(sums[k]) / repetitions, 0.3) << name_of(model) << " " << k;
        }
    }
}

TEST(NdfFitIndependent, LikelihoodPrefersTheTrueModel) {
    for (const NdfModel model : {NdfModel::beckmann, NdfModel::ggx}) {
        const auto fits = fit_ndf(draw({model, 0.3, 0.3, 0}, 20000, 5));
        const int other = fit_index(model == NdfModel::ggx ? NdfModel::beckmann : NdfModel::ggx, true);
        EXPECT_LT(fits[fit_index(model, true)].aic, fits[other].aic - 100);
        // Likelihood of the true model per facet: minus the entropy of its slopes, ln(pi alpha^2) + 1 or + 2.
        EXPECT_NEAR(fits[fit_index(model, true)].log_likelihood / 20000,
                    -std::log(pi * 0.09) - (model == NdfModel::beckmann ? 1 : 2), 0.05);
    }
}

// A field has fewer independent facets than facets: the reference gives the scatter over realisations.
TEST(NdfFitField, EffectiveSizeOfGaussianFields) {
    int n_checked = 0;
    for (const auto& e : reference("ndf_fit_gaussian_field")) {
        const int ratio = e["L_over_l"];
        if (ratio < 16 || ratio > 64) continue;
        ++n_checked;
        const HeightField s = generate_gaussian(8 * ratio, 8 * ratio, 1e-6, 8e-6, 0.3, 7);
        const NdfResult r = measure_ndf(s);
        const double iso = r.fits[0].se_alpha / r.fits[0].alpha,
                     axis = r.fits[1].se_alpha_x / r.fits[1].alpha_x;
        EXPECT_NEAR(iso / e["rel_std_alpha_isotropic_fit"].get<double>(), 1, 0.15) << ratio;
        EXPECT_NEAR(axis / e["rel_std_alpha_x_anisotropic_fit"].get<double>(), 1, 0.15) << ratio;
    }
    EXPECT_EQ(n_checked, 3);
}

// generate_gaussian makes the rms slope exact, so alpha of the isotropic fit is exact too; each axis alone
// scatters.
TEST(NdfFitField, GaussianFieldsAreRecovered) {
    double sum = 0;
    const int n = 40;
    for (int seed = 0; seed < n; ++seed) {
        const NdfResult r = measure_ndf(generate_gaussian(192, 192, 1e-6, 6e-6, 0.5, seed));
        EXPECT_NEAR(r.fits[0].alpha, 0.5, 1e-5);
        const double alpha_x = std::sqrt(2.0) * r.rms_slope_x;
        // Half of the scatter of an axis is common to both and was scaled away: Var(ln ax) - Var(ln a)
        // remains.
        const double rel = std::sqrt(std::pow(r.fits[1].se_alpha_x / r.fits[1].alpha_x, 2) -
                                     std::pow(r.fits[0].se_alpha / r.fits[0].alpha, 2));
        sum += std::pow((alpha_x / 0.5 - 1) / rel, 2);
        EXPECT_EQ(r.fits[r.best].model, NdfModel::beckmann);
        EXPECT_NEAR(r.table.projected_area_norm, 1, 2e-3);
    }
    EXPECT_GT(std::sqrt(sum / n), 0.7);  // rms of 40 pulls: 1 within 11 %
    EXPECT_LT(std::sqrt(sum / n), 1.3);
}

TEST(NdfFitField, AnisotropyAndItsAxisAreRecovered) {
    // A field stretched in y by its pitch, seen upright; then sheared copies would be other fields, so the
    // turn is by quarter.
    HeightField s = generate_gaussian(256, 256, 1e-6, 8e-6, 0.6, 2);
    s.pitch_y *= 3;
    const NdfFit fit = measure_ndf(s).fits[1];
    EXPECT_NEAR(fit.alpha_x, 0.6, 3 * fit.se_alpha_x);
    EXPECT_NEAR(fit.alpha_y, 0.2, 3 * fit.se_alpha_y);
    EXPECT_NEAR(fit.rotation_deg, 0, 3 * fit.se_rotation_deg);
    EXPECT_LT(fit.se_rotation_deg, 3);
    EXPECT_LT(measure_ndf(s).fits[1].aic, measure_ndf(s).fits[0].aic);
}

TEST(NdfFitField, RotationOfASumOfWaves) {
    // h = a cos(k . x): all slopes along k, which stands at atan(1/2); 63.4 deg belongs to the other axis.
    const int n = 64;
    std::vector<double> heights;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) heights.push_back(0.5 * std::cos(2 * pi * (4 * i + 2 * j) / n));
    const NdfResult r = measure_ndf(make_height_field(n, n, 1, 1, heights));
    EXPECT_NEAR(r.fits[1].rotation_deg, degrees(std::atan(0.5)), 1.5);
    EXPECT_GT(r.fits[1].alpha_x, 5 * r.fits[1].alpha_y);
}

// Gathering into cells must not be seen: the same slopes, one by one and gathered.
TEST(NdfFitField, CellsLoseNothing) {
    const HeightField s = generate_gaussian(256, 256, 1e-6, 4e-6, 0.7, 9);
    std::vector<Gradient> slopes;
    for_each_facet(s, [&](const Gradient& g) { slopes.push_back(g); });
    const auto direct = fit_ndf(slopes), gathered = measure_ndf(s).fits;
    for (int k = 0; k < 4; ++k) {
        EXPECT_NEAR(gathered[k].alpha_x / direct[k].alpha_x, 1, 1e-4) << k;
        EXPECT_NEAR(gathered[k].alpha_y / direct[k].alpha_y, 1, 1e-4) << k;
    }
    EXPECT_NEAR(gathered[1].alpha_x / direct[1].alpha_x, 1, 1e-9);
    // Facets of the mesh, not a difference scheme of ours.
    EXPECT_EQ(slopes[2].x, facet_gradient(s, 0, 1, 0).x);
    EXPECT_EQ(slopes[3].y, facet_gradient(s, 1, 1, 0).y);
    EXPECT_EQ(slopes.back().x, facet_gradient(s, 1, 255, 255).x);
    EXPECT_EQ(slopes.back().y, facet_gradient(s, 1, 255, 255).y);
}

TEST(NdfFitField, OneRow) {
    const NdfResult r = measure_ndf(generate_gaussian(4096, 1, 1e-6, 8e-6, 0.4, 3));
    ASSERT_EQ(r.fits.size(), 4u);
    EXPECT_NEAR(r.fits[1].alpha_x, std::sqrt(2.0) * 0.4, 1e-4);
    EXPECT_EQ(r.fits[1].alpha_y, 0);
    EXPECT_EQ(r.fits[1].rotation_deg, 0);
    EXPECT_GT(r.fits[1].se_alpha_x, 0);
    ASSERT_EQ(r.best, 1);
    EXPECT_NE(r.fits[1].message.find("along one axis"), std::string::npos);
    // n_eff = L / integral of rho^2, rho = (1 - 2 x^2/l^2) exp(-x^2/l^2): the integral is (3/4) sqrt(pi/2) l.
    EXPECT_NEAR(r.n_effective.alpha_x / (512 / (0.75 * std::sqrt(pi / 2))), 1, 0.15);
}

TEST(NdfFitField, FlatSurfaceIsSaidToBeFlat) {
    const NdfResult r = measure_ndf(generate_plane(8, 1e-6));
    EXPECT_EQ(r.message, "the surface is flat");
    for (const NdfFit& fit : r.fits) {
        EXPECT_TRUE(fit.converged);
        EXPECT_EQ(fit.alpha, 0);
        EXPECT_EQ(fit.se_alpha, 0);
        EXPECT_NE(fit.message.find("flat"), std::string::npos);
    }
    EXPECT_NEAR(r.table.projected_area_norm, 1, 1e-3);
}

TEST(NdfFitField, StressedSurfacesGiveFiniteAnswers) {
    HeightField spike = generate_plane(16, 1e-6);
    spike = make_height_field(16, 16, 1e-6, 1e-6, [] {
        std::vector<double> h(256, 0.0);
        h[100] = 1e-3;
        return h;
    }());
    const HeightField surfaces[] = {spike,
                                    generate_v_groove(64, 64e-6, 45),
                                    generate_rectangular_groove(64, 64e-6, 32e-6, 10e-6),
                                    generate_egg_crate(64, 64e-6, 1e-6),
                                    generate_gaussian(64, 64, 1e-6, 4e-6, 1e-6, 1),
                                    generate_gaussian(64, 64, 1e-6, 4e-6, 1e3, 1),
                                    make_height_field(1, 1, 1, 1, {5}),
                                    make_height_field(2, 2, 1, 1, {0, 1, 2, 0}),
                                    make_height_field(1, 4, 1, 1, {0, 1, 0, 3})};
    for (const HeightField& s : surfaces) {
        const NdfResult r = measure_ndf(s);
        EXPECT_EQ(r.fits.size(), 4u);
        for (const NdfFit& f : r.fits) {
            for (const double x : {f.alpha, f.alpha_x, f.alpha_y, f.rotation_deg, f.se_alpha, f.se_alpha_x,
                                   f.se_alpha_y, f.se_rotation_deg, f.log_likelihood, f.aic})
                EXPECT_TRUE(std::isfinite(x))
                    << s.nx << " x " << s.ny << " " << name_of(f.model) << " " << f.message;
        }
        for (const double d : r.table.d) EXPECT_TRUE(std::isfinite(d) && d >= 0);
        EXPECT_EQ(ndf_text(r).find("nan"), std::string::npos);
    }
    // Nearly all facets level: GGX has no maximum, and says so instead of returning a tiny alpha.
    const NdfResult r = measure_ndf(spike);
    EXPECT_FALSE(r.fits[2].converged);
    EXPECT_NE(r.fits[2].message.find("no maximum"), std::string::npos);
}

TEST(NdfFitField, TheTableIsTheDistribution) {
    const HeightField s = generate_gaussian(512, 512, 1e-6, 8e-6, 0.4, 4);
    const NdfResult r = measure_ndf(s);
    const NdfShape shape{NdfModel::beckmann, 0.4, 0.4, 0};
    double worst = 0;
    for (int t = 0; t < 30; ++t) {  // well-filled rings: mean over azimuth against the model
        double mean = 0;
        for (int p = 0; p < r.table.n_phi; ++p) mean += r.table.d[t * r.table.n_phi + p] / r.table.n_phi;
        const double theta = 0.5 * (r.table.theta_edges_deg[t] + r.table.theta_edges_deg[t + 1]);
        worst = std::max(worst, std::abs(mean / ndf_value(shape, to_vector({theta, 0})) - 1));
    }
    EXPECT_LT(worst, 0.15);
    EXPECT_NEAR(r.table.projected_area_norm, 1, 1e-3);
    // Grooves along y tilt the normals along x: only the bins on the axis are filled.
    const NdfTable grooves = measure_ndf(generate_v_groove(64, 64e-6, 30)).table;
    for (int t = 0; t < grooves.n_theta(); ++t)
        for (int p = 0; p < grooves.n_phi; ++p)
            if (grooves.d[t * grooves.n_phi + p] > 0) {
                EXPECT_TRUE(p == 0 || p == grooves.n_phi / 2) << p;
                EXPECT_LE(grooves.theta_edges_deg[t], 30.0);
                EXPECT_GT(grooves.theta_edges_deg[t + 1], 29.99);
            }
}

TEST(NdfFitField, AfmSample) {
    RawHeights raw = read_heights(GONIO_TEST_DATA "/samples/afm_rough.gsf");
    PrepareOptions options;
    options.boundary = Boundary::mirror;
    const NdfResult r = measure_ndf(prepare_surface(raw, options).surface);
    const double se = r.fits[0].se_alpha;
    EXPECT_NEAR(r.fits[0].alpha, 0.19, 0.01);
    EXPECT_LT(se / r.fits[0].alpha, 0.1);
    EXPECT_GT(se / r.fits[0].alpha, 0.002);
    EXPECT_GE(r.best, 0);
}

// Mirrored copies are no new facets: the errors stay those of the original.
TEST(NdfFitField, MirroredCopiesAreNotCountedTwice) {
    const HeightField s = generate_gaussian(128, 128, 1e-6, 4e-6, 0.5, 6);
    std::vector<double> heights;
    for (int j = 0; j < 256; ++j)
        for (int i = 0; i < 256; ++i) heights.push_back(s.at(std::min(i, 255 - i), std::min(j, 255 - j)));
    const double once = measure_ndf(s).fits[0].se_alpha;
    const double mirrored = measure_ndf(make_height_field(256, 256, 1e-6, 1e-6, heights)).fits[0].se_alpha;
    EXPECT_NEAR(mirrored / once, 1, 0.1);
}

TEST(NdfFitField, MillionsOfFacetsInSeconds) {
    const HeightField s = generate_gaussian(2048, 2048, 1e-6, 6e-6, 0.5, 1);
    const auto start = std::clock();
    const NdfResult r = measure_ndf(s);
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    RecordProperty("cpu_ms", static_cast<int>(1000 * seconds));
    EXPECT_NEAR(r.fits[0].alpha, 0.5, 1e-5);
    EXPECT_LT(seconds, 60);  // 1-2 s; sanitizers take their share
}

}  // namespace
}  // namespace gonio
