// A periodic Gaussian random field: white noise through the separable filter whose square is the spectrum of
// the wrapped autocorrelation exp(-r^2 / l^2). By Poisson's sum that spectrum is a sum of shifted Gaussians,
// positive by construction, so the autocorrelation is exact on the grid at any l. (The tempting kernel exp(-2
// r^2 / l^2) in space is exact only in the continuum: at l = 1 cell its autocorrelation is off by 30 %.)
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

#include "base/error.h"
#include "base/random.h"
#include "base/text.h"
#include "surface/generate.h"

namespace gonio {
namespace {

constexpr uint64_t noise_stream =
    0x6865696768747331;  // "heights1": apart from every stream of the measurements

std::complex<double> normal_pair(uint32_t a, uint32_t b) {
    const double r = std::sqrt(-2 * std::log((a + 0.5) * 0x1p-32)), phi = 2 * pi * uniform_double(b);
    return {r * std::cos(phi), r * std::sin(phi)};
}

std::vector<double> white_noise(size_t count, uint64_t seed) {
    std::vector<double> noise(count + 3);
    for (size_t k = 0; k < count; k += 4) {
        const auto words = random_words(seed, noise_stream, k / 4);
        const auto first = normal_pair(words[0], words[1]), second = normal_pair(words[2], words[3]);
        noise[k] = first.real(), noise[k + 1] = first.imag();
        noise[k + 2] = second.real(), noise[k + 3] = second.imag();
    }
    noise.resize(count);
    return noise;
}

// Square root of the spectrum of the wrapped exp(-x^2 / l^2), l in cells >= 1: sum over aliases k of exp(-(pi
// l (m / n + k))^2).
std::vector<double> filter_spectrum(int n, double l) {
    std::vector<double> spectrum(n);
    for (int m = 0; m < n; ++m) {
        double sum = 0;
        for (int k = -4; k <= 3; ++k)
            sum += std::exp(-std::pow(pi * l * (static_cast<double>(m) / n + k), 2));
        spectrum[m] = std::sqrt(sum);
    }
    return spectrum;
}

// Filters n_lines lines of n values; value k of line a is field[a * line_stride + k * stride]. Lines go in
// pairs as real and imaginary part (the filter is real and even, so it keeps them apart), and in blocks that
// share cache lines.
void filter_lines(std::vector<double>& field, int n_lines, int n, size_t line_stride, size_t stride,
                  const std::vector<double>& spectrum) {
    if (n == 1) return;
    constexpr int block = 16;
    Eigen::FFT<double> fft;
    std::vector<std::vector<std::complex<double>>> lines(block / 2, std::vector<std::complex<double>>(n));
    std::vector<std::complex<double>> transform(n);
    for (int first = 0; first < n_lines; first += block) {
        const int count = std::min(block, n_lines - first);
        for (int k = 0; k < n; ++k)
            for (int a = 0; a < count; a += 2) {
                const double* value = &field[(first + a) * line_stride + k * stride];
                lines[a / 2][k] = {value[0], a + 1 < count ? value[line_stride] : 0.0};
            }
        for (int a = 0; a < count; a += 2) {
            fft.fwd(transform, lines[a / 2]);
            for (int m = 0; m < n; ++m) transform[m] *= spectrum[m];
            fft.inv(lines[a / 2], transform);
        }
        for (int k = 0; k < n; ++k)
            for (int a = 0; a < count; a += 2) {
                double* value = &field[(first + a) * line_stride + k * stride];
                value[0] = lines[a / 2][k].real();
                if (a + 1 < count) value[line_stride] = lines[a / 2][k].imag();
            }
    }
}

// rms of |grad h| over both facet kinds: each difference along x (and along y) belongs to one facet of each
// kind.
double rms_gradient(const std::vector<double>& h, int nx, int ny, double pitch) {
    double sum = 0;
    for (int j = 0; j < ny; ++j) {
        const double* row = &h[static_cast<size_t>(j) * nx];
        const double* next = &h[static_cast<size_t>((j + 1) % ny) * nx];
        double row_sum = 0;
        for (int i = 0; i < nx; ++i) {
            const double dx = row[i + 1 < nx ? i + 1 : 0] - row[i], dy = next[i] - row[i];
            row_sum += dx * dx + dy * dy;
        }
        sum += row_sum;
    }
    return std::sqrt(sum / static_cast<double>(h.size())) / pitch;
}

}  // namespace

HeightField generate_gaussian(int samples_x, int samples_y, double pitch, double correlation_length,
                              double rms_slope, uint64_t seed) {
    const int shorter = samples_y == 1 ? samples_x : std::min(samples_x, samples_y);
    if (shorter < 4 || std::max(samples_x, samples_y) > 1 << 16)
        throw Error(ErrorCode::invalid_input, "samples",
                    std::to_string(samples_x) + " x " + std::to_string(samples_y),
                    "a Gaussian surface needs 4 to 65536 samples along x, and along y as many or exactly 1");
    if (!(correlation_length >= pitch && correlation_length <= shorter * pitch / 4))
        throw Error(ErrorCode::invalid_input, "correlation_length", number_text(correlation_length) + " m",
                    "must lie between one pitch and a quarter of the side, else the grid cannot hold it");
    if (!(rms_slope >= 0 && rms_slope <= 1e6))
        throw Error(ErrorCode::invalid_input, "rms_slope", number_text(rms_slope), "must lie in [0, 1e6]");

    const double l = correlation_length / pitch;
    std::vector<double> field = white_noise(static_cast<size_t>(samples_x) * samples_y, seed);
    filter_lines(field, samples_y, samples_x, samples_x, 1, filter_spectrum(samples_x, l));
    filter_lines(field, samples_x, samples_y, 1, samples_x, filter_spectrum(samples_y, l));
    const double scale = rms_slope / rms_gradient(field, samples_x, samples_y, pitch);
    for (double& h : field) h *= scale;
    return make_height_field(samples_x, samples_y, pitch, pitch, field);
}

}  // namespace gonio
