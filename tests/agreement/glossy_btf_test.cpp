// Pictures of glossy facets against closed forms, the Lambertian engine, the BRDF and the path tracer.
#include "measure/glossy_btf.h"

#include "agreement/measured.h"
#include "base/half.h"
#include "material/facet_brdf.h"
#include "measure/reference.h"
#include "surface/generate.h"

namespace gonio {
namespace {

const std::vector<AnglesDeg> lights = {{10, 0}, {40, 40}, {60, 200}}, views = {{0, 0}, {45, 10}, {60, 130}};

HeightField field() {
    return generate_gaussian(64, 64, 1, 8, 0.6, 11);
}

Material ggx(double alpha, double reflectance = 0.9) {
    Microfacet lobe;
    lobe.alpha_x = lobe.alpha_y = alpha;
    lobe.reflectance.reflectance = reflectance;
    return {{"y"}, lobe};
}

BtfPlan plan_of_pictures(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing) {
    BtfPlan plan;
    plan.incident = std::move(incident);
    plan.outgoing = std::move(outgoing);
    return plan;
}

struct Measured {
    Btf btf;
    Report report;
    std::vector<std::vector<float>> images;  // [view], [light][channel][pixel]

    double mean_of(size_t view, size_t plane) const {
        double sum = 0;
        const size_t n = btf.shape.n_pixels();
        for (size_t p = 0; p < n; ++p) sum += images[view][plane * n + p];
        return sum / static_cast<double>(n);
    }
};

Measured pictures(const HeightField& surface, const Material& material, const BtfPlan& plan,
                  int n_threads = 1) {
    RunOptions options;
    options.n_threads = n_threads;
    const Monitor monitor;
    GlossyBtf glossy(surface, material, plan, options, monitor);
    Measured measured;
    measured.report = glossy.report();
    measured.btf = glossy.pictures([&](int, std::span<const uint16_t> images) {
        auto& values = measured.images.emplace_back();
        for (const uint16_t half : images) values.push_back(from_half_bits(half));
    });
    return measured;
}

TEST(GlossyBtf, OfAPlaneIsItsBrdf) {
    HeightField plane = generate_plane(4, 1);
    const Material material = ggx(0.3);
    const Measured flat = pictures(plane, material, plan_of_pictures(lights, views));
    const FacetBrdf facet(material, plane, 0, 0, 0);
    for (size_t v = 0; v < views.size(); ++v)
        for (size_t l = 0; l < lights.size(); ++l) {
            double f = 0;
            facet.eval(to_vector(lights[l]), to_vector(views[v]), {&f, 1});
            for (size_t p = 0; p < flat.btf.shape.n_pixels(); ++p)
                EXPECT_NEAR(flat.images[v][l * flat.btf.shape.n_pixels() + p], f, 1e-3 * f);
        }
}

TEST(GlossyBtf, OfAPlaneLooksToEveryPixelFromTheCamera) {
    const HeightField plane = generate_plane(4, 1);
    const Material material = ggx(0.4);
    BtfPlan plan = plan_of_pictures(lights, {});
    plan.cameras = CameraPlane{2, 1, 6, 2, 3};
    plan.pixels_x = plan.pixels_y = 5;
    const Measured flat = pictures(plane, material, plan);
    const FacetBrdf facet(material, plane, 0, 0, 0);
    const std::vector<Vec3> places = camera_places(plane, plan);
    for (size_t v = 0; v < 2; ++v)
        for (int p = 0; p < 25; ++p) {
            const Vec3 d{places[v].x - (p % 5 + 0.5) * plane.width() / 5,
                         places[v].y - (p / 5 + 0.5) * plane.depth() / 5, 3};
            const double length = std::sqrt(dot(d, d));
            double f = 0;
            facet.eval(to_vector(lights[1]), {d.x / length, d.y / length, d.z / length}, {&f, 1});
            EXPECT_NEAR(flat.images[v][25 + p], f, 1e-3 * f) << v << " " << p;
        }
}

// The same pictures by two engines: Lambertian facets, from directions and from cameras.
TEST(GlossyBtf, OfLambertianFacetsIsThatOfTheOtherEngine) {
    for (const bool from_cameras : {false, true}) {
        BtfPlan plan = plan_of_pictures(lights, views);
        plan.accuracy.samples = Accuracy::Samples{4, 256, 1, 4};
        if (from_cameras) plan.cameras = CameraPlane{2, 1, 40, 40, 50};
        const Measured glossy = pictures(field(), gray({0.8, 0.3}), plan);
        const Btf lambertian = measure_btf(field(), gray({0.8, 0.3}), plan, {}).btf;
        const BtfShape& shape = lambertian.shape;
        std::vector<uint16_t> images(shape.images_size() / shape.n_views);
        for (int v = 0; v < shape.n_views; ++v) {
            expand_view(shape, lambertian.radiance, lambertian.view_maps, v, images);
            for (size_t l = 0; l < lights.size(); ++l)
                for (size_t c = 0; c < 2; ++c) {
                    double squares = 0;
                    for (size_t p = 0; p < shape.n_pixels(); ++p) {
                        const size_t at = (l * 2 + c) * shape.n_pixels() + p;
                        squares += std::pow(glossy.images[v][at] - from_half_bits(images[at]), 2);
                    }
                    const double rms = std::sqrt(squares / static_cast<double>(shape.n_pixels())),
                                 stated = std::hypot(glossy.btf.pixel_se[c * lights.size() + l],
                                                     lambertian.pixel_se[c * lights.size() + l]);
                    EXPECT_LE(rms, 1.5 * stated) << v << " " << l << " " << c;
                    EXPECT_LE(stated, 0.06 * glossy.mean_of(v, l * 2 + c));
                }
        }
    }
}

void expect_agrees(const Btf& btf, const Table& judge, double most) {
    double deviation = 0;
    for (size_t k = 0; k < judge.f.size(); ++k) {
        const double sigma = (btf.mean.f[k] - judge.f[k]) / std::hypot(doubt(btf.mean, k), doubt(judge, k));
        EXPECT_LE(std::abs(sigma), 3.5) << "row " << k << ": " << btf.mean.f[k] << ", not " << judge.f[k];
        EXPECT_LE(doubt(btf.mean, k), 0.03 * judge.f[k]) << "an error bar that says nothing";
        deviation += sigma * sigma / static_cast<double>(judge.f.size());
    }
    EXPECT_LE(deviation, most);
}

TEST(GlossyBtf, HasTheBrdfAsItsMean) {
    for (const double alpha : {0.25, 0.5}) {
        BtfPlan plan = plan_of_pictures(lights, views);
        plan.pixels_x = plan.pixels_y = 96;
        plan.pixel_samples = 2;
        const Measured measured = pictures(field(), ggx(alpha), plan);
        const Table brdf = measure(field(), ggx(alpha), plan_for_target(lights, views, 0.003)).table;
        expect_agrees(measured.btf, brdf, 1.9);  // chi-square of nine, 95 %
        for (size_t v = 0; v < views.size(); ++v)
            for (size_t l = 0; l < lights.size(); ++l) {
                const double stated = measured.btf.mean.f[l * views.size() + v];
                EXPECT_NEAR(measured.mean_of(v, l), stated, 2e-4 * stated);
            }
    }
}

// A small relief is the block of pixels that the path tracer sees, steep enough for a third of the light to
// come over other facets.
TEST(GlossyBtf, AgreesWithThePathTracer) {
    const HeightField block = generate_gaussian(16, 16, 1, 4, 1.0, 3);
    BtfPlan plan = plan_of_pictures(lights, views);
    plan.pixels_x = plan.pixels_y = 96;
    plan.accuracy.samples = Accuracy::Samples{8, 256, 2, 8};
    const Measured measured = pictures(block, ggx(0.4), plan);
    ReferenceOptions paths;
    paths.paths = 1 << 15;
    const Table traced = measure_reference(block, ggx(0.4), plan_of(lights, views), paths, {}, {}).table;
    expect_agrees(measured.btf, traced, 1.9);
    plan.max_order = 1;
    const Measured direct = pictures(block, ggx(0.4), plan);
    double first = 0, all = 0;
    for (size_t k = 0; k < traced.f.size(); ++k) first += direct.btf.mean.f[k], all += measured.btf.mean.f[k];
    EXPECT_LT(first, 0.97 * all);
}

// No pair meets lobes of alpha 1e-4, and those of 0.05 rarely two of them: what the BRDF has by rays along
// lobes, or states as missing, the bias of the means holds; and every pixel misses what they do.
TEST(GlossyBtf, KnowsWhatNarrowLobesHide) {
    BtfPlan plan = plan_of_pictures(lights, views);
    plan.pixels_x = plan.pixels_y = 64;
    plan.accuracy.samples = Accuracy::Samples{4, 64, 1, 4};
    for (const double alpha : {0.05, 1e-4}) {
        const Measured measured = pictures(field(), ggx(alpha), plan);
        const Table brdf =
            measure(field(), ggx(alpha), plan_of(lights, views, Accuracy::Samples{16, 1024, 1, 16})).table;
        for (size_t l = 0; l < lights.size(); ++l) {
            double missed = 0;
            for (size_t v = 0; v < views.size(); ++v) {
                const size_t k = l * views.size() + v;
                const Table& mean = measured.btf.mean;
                const double off = mean.f[k] - brdf.f[k], sigma = std::hypot(doubt(mean, k), doubt(brdf, k));
                EXPECT_LE(std::abs(off), 3 * sigma) << alpha << " " << k;
                missed += std::pow(mean.bias[k], 2) / static_cast<double>(views.size());
                if (alpha == 1e-4) {
                    EXPECT_GE(mean.bias[k], 0.95 * brdf.bias[k]);
                }
            }
            EXPECT_GT(measured.btf.pixel_se[l], 0.9 * std::sqrt(missed));
        }
    }
}

TEST(GlossyBtf, HasTheSameBitsOnAnyNumberOfThreads) {
    const BtfPlan plan = plan_of_pictures(lights, views);
    const Measured a = pictures(field(), ggx(0.3), plan, 1), b = pictures(field(), ggx(0.3), plan, 3);
    EXPECT_EQ(a.images, b.images);
    EXPECT_EQ(a.btf.mean.se, b.btf.mean.se);
    EXPECT_EQ(a.btf.pixel_se, b.btf.pixel_se);
}

TEST(GlossyBtf, RefusesWhatHasNoPicture) {
    Mirror mirror;
    mirror.reflectance.reflectance = 1.0;
    const BtfPlan plan = plan_of_pictures(lights, views);
    EXPECT_THROW(pictures(field(), {{"y"}, mirror}, plan), Error);
    RunOptions small;
    small.max_bytes = 1 << 20;
    const Monitor monitor;
    try {
        GlossyBtf(field(), ggx(0.3), plan, small, monitor);
        ADD_FAILURE() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::limit);
    }
}

}  // namespace
}  // namespace gonio
