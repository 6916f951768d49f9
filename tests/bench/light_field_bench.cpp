// Light fields of 32 x 32 views: CPU seconds of the triangle field of the paper (Heidrich et al. 2000, table
// 1: 32 x 32 points; 6 to 8 minutes there for all its data) and of a relief of 512 x 512 points, from
// directions (lockstep march) and from cameras (single rays).
//   light_field_bench [HEIGHT_MAP WIDTH HEIGHT_RANGE]   a height map instead of a Gaussian field
#include <cstdio>
#include <string>

#include "server/run_job.h"
#include "tests/bench/bench.h"

using namespace gonio;

namespace {

void run(const std::string& name, const HeightField& surface, int pixels, bool cameras) {
    LightFieldPlan plan;
    plan.incident = {{45, 135}};
    plan.pixels_x = plan.pixels_y = pixels;
    plan.accuracy.samples = Accuracy::Samples{1, 64, 1, 4};
    if (cameras) {
        plan.cameras = CameraPlane{32, 32, surface.width(), surface.depth(), 2 * surface.width()};
    } else {
        for (int v = 0; v < 32; ++v)
            for (int u = 0; u < 32; ++u) {
                const double x = (u + 0.5) / 32 - 0.5, y = (v + 0.5) / 32 - 0.5;
                plan.outgoing.push_back(
                    {degrees(std::atan(std::hypot(x, y) / 2)), degrees(std::atan2(y, x))});
            }
    }
    const double start = bench::cpu_seconds();
    const BtfResult result = measure_btf(surface, bench::lambertian(0.8), plan, {});
    const double computing = bench::cpu_seconds() - start;
    const BtfShape& shape = result.btf.shape;
    std::vector<uint16_t> image(shape.images_size() / shape.n_views);
    for (int view = 0; view < shape.n_views; ++view)
        expand_view(shape, result.btf.radiance, result.btf.view_maps, view, image);
    std::printf(
        "%s, 32 x 32 views of %d x %d pixels from %s: %.2f s, with the images %.2f s; error of means %.1e, "
        "of a pixel %.1e\n",
        name.c_str(), pixels, pixels, cameras ? "cameras" : "directions", computing,
        bench::cpu_seconds() - start, result.report.relative_error,
        result.btf.pixel_se[0] / result.btf.mean.f[0]);
}

// Pyramids of random height on a grid of 4 cells: large flat triangles, as in figure 2.
HeightField triangles() {
    std::vector<double> heights(32 * 32, 0.0);
    for (int j = 2; j < 32; j += 4)
        for (int i = 2; i < 32; i += 4) {
            const double top = 1 + 2 * fractional_part(0.618034 * (i + 7 * j));
            for (int b = -1; b <= 1; ++b)
                for (int a = -1; a <= 1; ++a)
                    heights[(j + b) * 32 + i + a] = top * (1 - 0.5 * std::max(std::abs(a), std::abs(b)));
        }
    return make_height_field(32, 32, 1e-3, 1e-3, [&] {
        for (double& h : heights) h *= 1e-3;
        return heights;
    }());
}

}  // namespace

int main(int argc, char** argv) {
    for (const bool cameras : {false, true}) run("triangles 32 x 32", triangles(), 256, cameras);
    HeightField relief = bench::field(512, 0.7);
    std::string name = "Gaussian field 512 x 512";
    if (argc == 4) {
        const std::string document = std::string(R"({"file": ")") + argv[1] + R"(", "width": ")" + argv[2] +
                                     R"(", "height_range": ")" + argv[3] + R"(", "resample": [512, 512]})";
        relief = load_surface(parse_surface_job(R"({"surface": )" + document + "}", {})).surface;
        name = argv[1];
    }
    for (const bool cameras : {false, true}) run(name, relief, 256, cameras);
}
