// A BTF of 81 x 81 directions and 256 x 256 pixels, Lambert 0.8, three bounces (orders 1 to 4), 64 directions
// in two runs: CPU seconds of computing, filling the images and writing them, against a plain write of as
// many bytes to a new file: CPU of write(), and the time until they are on the disk. Peak memory is the
// process's: one case a process; more than 1 GiB or a factored file above 45 MB fails.
//   btf_bench SLOPE CORRELATION_CELLS [FOLDER [N]]
#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "server/btf_file.h"
#include "tests/bench/bench.h"

using namespace gonio;

namespace {

double peak_mib() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024;
}

struct PlainWrite {
    double cpu, until_on_disk;  // seconds; the latter by the clock on the wall
};

// To pages that nobody has touched yet, and out to the disk.
PlainWrite plain_write(const std::string& path, size_t bytes) {
    const std::vector<char> piece(8 << 20, 1);
    const double start = bench::cpu_seconds(), wall = bench::wall_seconds();
    const int file = ::open(path.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0644);
    for (size_t left = bytes; left > 0;) {
        const ssize_t n = ::write(file, piece.data(), std::min(left, piece.size()));
        if (n <= 0) std::abort();
        left -= static_cast<size_t>(n);
    }
    if (::fsync(file) != 0) std::abort();
    ::close(file);
    return {bench::cpu_seconds() - start, bench::wall_seconds() - wall};
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) {
        std::fprintf(stderr, "usage: btf_bench SLOPE CORRELATION_CELLS [FOLDER [N]]\n");
        return 2;
    }
    const std::string folder = argc > 3 ? argv[3] : ".", n = argc > 4 ? argv[4] : "256";
    const std::string document = R"({"surface": {"generate": "gaussian", "samples": )" + n +
                                 R"(, "pitch": "1 um", "correlation_length": ")" + argv[2] +
                                 R"( um", "rms_slope": )" + argv[1] +
                                 R"(}, "material": {"model": "lambertian", "albedo": 0.8},
            "measure": {"kind": "btf", "incident": {"bonn": 81}, "outgoing": {"bonn": 81}, "max_order": 4},
            "accuracy": {"samples": {"directions": 32, "replicates": 2}}})";
    const LoadedJob job = load_job(parse_job(document, {}));
    const auto& plan = std::get<BtfPlan>(job.job.plan);
    const double before_mib = peak_mib();

    double start = bench::cpu_seconds();
    const BtfResult result = measure_btf(job.surface.surface, job.material, plan, {});
    const double computing = bench::cpu_seconds() - start;
    const BtfShape& shape = result.btf.shape;

    start = bench::cpu_seconds();
    std::vector<uint16_t> images(shape.images_size() / shape.n_views);
    for (int view = 0; view < shape.n_views; ++view)
        expand_view(shape, result.btf.radiance, result.btf.view_maps, view, images);
    const double filling = bench::cpu_seconds() - start;

    const std::string factored = folder + "/bench.btf", plain = folder + "/bench.images",
                      bytes = folder + "/bench.bytes";
    start = bench::cpu_seconds();
    write_factored_btf(job, result.btf, factored);
    const double writing_factored = bench::cpu_seconds() - start;
    start = bench::cpu_seconds();
    write_btf_images(job, result.btf, ImageForm::arrays, plain, {});
    const double writing = bench::cpu_seconds() - start;
    const size_t size = std::filesystem::file_size(plain);
    std::filesystem::remove(plain);
    const PlainWrite rival = plain_write(bytes, size);
    std::filesystem::remove(bytes);
    const double factored_mb = 1e-6 * static_cast<double>(std::filesystem::file_size(factored)),
                 peak = peak_mib();
    std::printf(
        "slope %s, l %s, N %s: computing %.2f s, filling %.2f s; cold plain write of %.0f MB: %.2f s, of "
        "that "
        "CPU %.2f s: computing %.0f %% of the write, %.0f %% of its CPU; images written in %.2f s CPU "
        "(synced), factored %.1f MB in %.2f s; memory %.0f MiB (%.0f before); error of means %.2e, of a "
        "pixel "
        "%.2e of the mean\n",
        argv[1], argv[2], n.c_str(), computing, filling, 1e-6 * static_cast<double>(size),
        rival.until_on_disk, rival.cpu, 100 * computing / rival.until_on_disk, 100 * computing / rival.cpu,
        writing, factored_mb, writing_factored, peak, before_mib, result.report.relative_error,
        result.btf.pixel_se[0] / result.btf.mean.f[0]);
    std::filesystem::remove(factored);
    return n == "256" && (peak > 1024 || factored_mb > 45) ? 1 : 0;
}
