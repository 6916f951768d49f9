// Projection to spherical harmonics: exact where it must be, near full quadrature from a few hundred samples.
#include "fitting/sh_projection.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/random.h"
#include "directions/hemisphere_quadrature.h"
#include "directions/spherical_harmonics.h"
#include "fitting/joint_basis.h"
#include "fitting/ridge_fit.h"
#include "unit/projected_brdfs.h"

namespace gonio {
namespace {

using test::measured;
using test::true_error;
using test::twelve_lights;
using Basis = ProjectionPlan::Basis;
using Form = ProjectionPlan::Form;
using Weighting = ProjectionPlan::Weighting;

ProjectionPlan plan_of(Basis basis, Form form, int samples, int order = 8) {
    ProjectionPlan plan;
    plan.basis = basis;
    plan.form = form;
    plan.samples = samples;
    plan.order = order;
    return plan;
}

// Coefficients by quadrature on a far denser grid than any projection uses.
HarmonicProjection by_full_quadrature(Basis basis, const std::vector<AnglesDeg>& lights,
                                      const test::TestBrdf& brdf) {
    constexpr int order = 8;
    HarmonicProjection result;
    result.plan = plan_of(basis, Form::per_light, 0, order);
    result.incident = lights;
    result.channels = {"y"};
    result.coefficients.resize(lights.size() * harmonic_count(order));
    result.se = result.bias = std::vector<double>(result.coefficients.size());
    std::vector<double> y(harmonic_count(order));
    const DirectionSet grid = hemisphere_quadrature(96, 128);
    for (size_t d = 0; d < grid.directions.size(); ++d) {
        const Vec3& wo = grid.directions[d];
        (basis == Basis::sh ? sh_basis : hsh_basis)(order, wo, y);
        for (size_t light = 0; light < lights.size(); ++light) {
            const Vec3 wi = to_vector(lights[light]);
            const double g = brdf.f(wi, wo) * wi.z * wo.z * grid.solid_angle[d];
            for (size_t k = 0; k < y.size(); ++k) result.coefficients[light * y.size() + k] += g * y[k];
        }
    }
    return result;
}

TEST(ShProjection, From400SamplesNearFullQuadrature) {
    const std::vector<AnglesDeg> lights = twelve_lights();
    for (const auto& brdf : test::test_brdfs()) {
        double full_hsh = 0;
        for (const Basis basis : {Basis::hsh, Basis::sh}) {
            const double full = true_error(by_full_quadrature(basis, lights, brdf), lights, brdf.f);
            const ProjectionPlan plan = plan_of(basis, Form::per_light, 400);
            const HarmonicProjection sparse = project(measured(plan, lights, brdf.f), plan);
            const double error = true_error(sparse, lights, brdf.f);
            RecordProperty(brdf.name + (basis == Basis::sh ? " SH" : " HSH"), std::to_string(error / full));
            EXPECT_LT(error, 1.15 * full) << brdf.name;
            EXPECT_LT(sparse.condition_number, 1.3);
            // What it says of itself: each sample was held out, so it errs on the careful side.
            double stated = 0;
            for (const double e : sparse.relative_error) stated += e / static_cast<double>(lights.size());
            EXPECT_GT(stated, 0.95 * error) << brdf.name;
            EXPECT_LT(stated, 1.4 * error) << brdf.name;
            const ProjectionPlan grid = plan_of(basis, Form::per_light, 0);
            EXPECT_LT(true_error(project(measured(grid, lights, brdf.f), grid), lights, brdf.f), 1.03 * full)
                << brdf.name;
            if (basis == Basis::hsh) full_hsh = full;
            EXPECT_LE(full_hsh, full);
        }
    }
}

TEST(ShProjection, JointFitOf400PairsInAll) {
    const std::vector<AnglesDeg> lights = twelve_lights();
    for (const auto& brdf : test::test_brdfs())
        for (const Basis basis : {Basis::sh, Basis::hsh}) {
            const ProjectionPlan plan = plan_of(basis, Form::joint, 400),
                                 grid = plan_of(basis, Form::joint, 0);
            const HarmonicProjection sparse = project(measured(plan, {}, brdf.f), plan);
            EXPECT_EQ(sparse.n_coefficients(), 120u);
            EXPECT_LT(sparse.condition_number, basis == Basis::sh ? 2.5 : 30);
            const double full = true_error(project(measured(grid, {}, brdf.f), grid), lights, brdf.f);
            const double error = true_error(sparse, lights, brdf.f);
            RecordProperty(brdf.name + (basis == Basis::sh ? " SH" : " HSH"), std::to_string(error / full));
            EXPECT_LT(error, (basis == Basis::sh ? 1.15 : 1.6) * full) << brdf.name;
            ASSERT_TRUE(sparse.isotropy_defect);
            EXPECT_LT(sparse.isotropy_defect->first, 1e-5);
        }
}

// A function that the basis holds is found again, to the precision of a table's floats.
TEST(ShProjection, RecoversBandLimitedFunctions) {
    for (const Form form : {Form::per_light, Form::matrix, Form::joint})
        for (const int samples : {0, 400}) {
            const int order = form == Form::per_light ? 8 : 4, count = harmonic_count(order);
            const ProjectionPlan plan = plan_of(Basis::hsh, form, samples, order);
            const std::vector<JointFunction> functions = joint_basis(order, true);
            Eigen::MatrixXd c(count, count);
            if (form == Form::joint) {
                Eigen::VectorXd q(functions.size());
                for (Eigen::Index k = 0; k < q.size(); ++k)
                    q[k] = uniform_double(random_words(3, 1, k)[0]) - 0.3;
                c = joint_to_matrix(functions, q, order);
            } else {
                for (Eigen::Index k = 0; k < c.size(); ++k)
                    c.data()[k] = uniform_double(random_words(3, 2, k)[0]) - 0.3;
            }
            const auto f = [&](const Vec3& wi, const Vec3& wo) {
                std::vector<double> y_i(count), y_o(count);
                hsh_basis(order, wi, y_i);
                hsh_basis(order, wo, y_o);
                const Eigen::Map<const Eigen::VectorXd> i(y_i.data(), count), o(y_o.data(), count);
                return i.dot(c * o) / (wi.z * wo.z);
            };
            const std::vector<AnglesDeg> lights{{30, 40}};
            const HarmonicProjection found = project(measured(plan, lights, f), plan);
            std::vector<double> y(count);
            hsh_basis(order, to_vector(lights[0]), y);
            const Eigen::VectorXd row = c.transpose() * Eigen::Map<const Eigen::VectorXd>(y.data(), count);
            double most = 0;
            for (size_t k = 0; k < found.n_coefficients(); ++k) {
                double expected = 0;
                if (form == Form::per_light) expected = row[static_cast<Eigen::Index>(k)];
                if (form == Form::matrix)
                    expected = c(static_cast<Eigen::Index>(k) / count, static_cast<Eigen::Index>(k) % count);
                if (form == Form::joint) expected = uniform_double(random_words(3, 1, k)[0]) - 0.3;
                most = std::max(most, std::abs(found.coefficients[k] - expected));
            }
            EXPECT_LT(most, 1e-6) << static_cast<int>(form) << ", " << samples;
            EXPECT_LT(found.relative_error[0], 1e-6);
        }
}

TEST(ShProjection, JointFitIsReciprocalAndIsotropic) {
    const ProjectionPlan plan = plan_of(Basis::hsh, Form::joint, 400);
    // Anisotropic and not reciprocal: neither survives, and the first is noticed.
    const auto f = [](const Vec3& wi, const Vec3& wo) { return 0.3 + 0.2 * wi.x * wo.x + 0.1 * wi.z; };
    const HarmonicProjection projection = project(measured(plan, {}, f), plan);
    const Table table = reconstruct(projection, {{20, 10}, {50, 100}, {50, 160}, {20, 70}},
                                    {{50, 100}, {20, 10}, {20, 70}, {50, 160}});
    EXPECT_NEAR(table.f[0], table.f[4 + 1], 1e-6);      // (a, b) and (b, a)
    EXPECT_NEAR(table.f[0], table.f[3 * 4 + 3], 1e-6);  // both turned by 60 degrees
    EXPECT_GT(projection.isotropy_defect->first, 0.1);
}

// Noise of known size goes into the table; what comes out scatters as stated.
TEST(ShProjection, StandardErrorsAreThoseOfTheCoefficients) {
    constexpr int n_noise = 200;
    for (const Form form : {Form::per_light, Form::matrix, Form::joint}) {
        const ProjectionPlan plan = plan_of(Basis::hsh, form, form == Form::matrix ? 20 : 100, 3);
        Table table = measured(plan, {{30, 40}}, [](const Vec3&, const Vec3&) { return 1 / pi; });
        const std::vector<float> exact = table.f;
        for (size_t row = 0; row < table.rows(); ++row)
            table.se[row] = 0.01f + 0.02f * static_cast<float>(row % 3);
        Eigen::VectorXd sum, squares;
        HarmonicProjection projection;
        for (int k = 0; k < n_noise; ++k) {
            for (size_t row = 0; row < table.rows(); ++row) {
                // Variance 1: a sum of twelve uniform numbers.
                double noise = -6;
                for (int part = 0; part < 3; ++part)
                    for (const uint32_t word : random_words(5, 100 + k, 3 * row + part))
                        noise += uniform_double(word);
                table.f[row] = exact[row] + table.se[row] * static_cast<float>(noise);
            }
            projection = project(table, plan);
            const Eigen::Map<const Eigen::VectorXd> c(projection.coefficients.data(),
                                                      static_cast<Eigen::Index>(projection.n_coefficients()));
            if (k == 0) sum = squares = Eigen::VectorXd::Zero(c.size());
            sum += c;
            squares += c.cwiseAbs2();
        }
        double chi_square = 0;
        for (Eigen::Index k = 0; k < sum.size(); ++k) {
            const double variance = (squares[k] - sum[k] * sum[k] / n_noise) / (n_noise - 1);
            chi_square += variance / std::pow(projection.se[k], 2) / static_cast<double>(sum.size());
        }
        // The mean of at least ten variances of 200 draws each is within 15 % with more than 99.9 %.
        EXPECT_NEAR(chi_square, 1, 0.15) << static_cast<int>(form);
    }
}

TEST(RidgeFit, HeldOutErrorsAreThoseOfRefitting) {
    Eigen::MatrixXd design(30, 6), g(30, 2);
    for (Eigen::Index k = 0; k < design.size(); ++k)
        design.data()[k] = uniform_double(random_words(7, 1, k)[0]) - 0.5;
    for (Eigen::Index k = 0; k < g.size(); ++k) g.data()[k] = uniform_double(random_words(7, 2, k)[0]);
    const Eigen::MatrixXd penalty = 0.3 * Eigen::MatrixXd::Ones(6, 6);
    const RidgeFit fit(design, penalty);
    const int ridge = fit.best_ridge(g);
    EXPECT_GT(ridge, 0);  // pure noise: shrinking it helps
    for (int left_out : {0, 7, 29}) {
        Eigen::MatrixXd rest = design, rest_g = g;
        rest.row(left_out).setZero();
        rest_g.row(left_out).setZero();
        const Eigen::MatrixXd normal =
            rest.transpose() * rest + penalty + fit.ridges()[ridge] * Eigen::MatrixXd::Identity(6, 6);
        const Eigen::MatrixXd c = normal.ldlt().solve(rest.transpose() * rest_g);
        const Eigen::MatrixXd expected = design.row(left_out) * c - g.row(left_out);
        EXPECT_LT((fit.held_out_errors(g, ridge).row(left_out) - expected).norm(), 1e-12);
        EXPECT_LT((fit.leave_one_out(ridge).row(left_out) * g - g.row(left_out) - expected).norm(), 1e-12);
    }
}

TEST(ShProjection, SameSeedSameDirections) {
    EXPECT_EQ(scattered_directions(400, 1, 2), scattered_directions(400, 1, 2));
    EXPECT_NE(scattered_directions(400, 1, 2), scattered_directions(400, 2, 2));
    for (const AnglesDeg& a : scattered_directions(400, 1, 2)) EXPECT_LT(a.theta_deg, 90);
}

TEST(ShProjection, RefusesWhatItCannotDo) {
    const auto code_and_field = [](const ProjectionPlan& asked, const Table& table) {
        try {
            project(table, asked);
        } catch (const Error& error) {
            return std::string(code_name(error.code())) + " " + error.field();
        }
        return std::string("nothing");
    };
    const auto lambert = [](const Vec3&, const Vec3&) { return 1 / pi; };
    const ProjectionPlan per_light = plan_of(Basis::hsh, Form::per_light, 400);
    const Table table = measured(per_light, {{30, 40}}, lambert);
    for (const int order : {-1, 0, 33, 1 << 30})
        EXPECT_EQ(code_and_field(plan_of(Basis::hsh, Form::per_light, 400, order), table),
                  "invalid_input order");
    EXPECT_EQ(code_and_field(plan_of(Basis::hsh, Form::per_light, 400, 21), table), "invalid_input samples");
    EXPECT_EQ(code_and_field(plan_of(Basis::sh, Form::joint, 400, 12), table), "nothing");  // 364 unknowns
    EXPECT_EQ(code_and_field(plan_of(Basis::sh, Form::joint, 400, 13), table), "invalid_input samples");
    EXPECT_EQ(code_and_field(plan_of(Basis::sh, Form::joint, 400, 32), table), "limit order");
    EXPECT_EQ(code_and_field(plan_of(Basis::hsh, Form::matrix, 400), table),
              "invalid_input samples");  // one light
    EXPECT_EQ(code_and_field(plan_of(Basis::hsh, Form::per_light, 0), table), "invalid_input outgoing");
    const ProjectionPlan joint = plan_of(Basis::hsh, Form::joint, 400);
    EXPECT_EQ(code_and_field(plan_of(Basis::hsh, Form::matrix, 400), measured(joint, {}, lambert)),
              "invalid_input form");
    EXPECT_THROW(reconstruct(project(table, per_light), {{31, 40}}, {{0, 0}}), Error);
}

TEST(ShProjection, BlackSurface) {
    for (const Form form : {Form::per_light, Form::matrix, Form::joint})
        for (const int samples : {0, 400}) {
            const ProjectionPlan plan = plan_of(Basis::sh, form, samples, 4);
            const HarmonicProjection found =
                project(measured(plan, {{30, 40}}, [](const Vec3&, const Vec3&) { return 0; }), plan);
            for (const auto& values : {found.coefficients, found.se, found.bias, found.relative_error})
                for (const double value : values) EXPECT_EQ(value, 0);
        }
}

}  // namespace
}  // namespace gonio
