// How many independent facets a correlated field of slopes is worth.
//
// For slopes (u, v) along the axes of the fit, jointly normal between places with covariances C(t) at the lag
// t of n places,
//   Var(mean u^2) = 2/n sum_t C_uu^2,   Var(mean v^2) = 2/n sum_t C_vv^2,
//   Var(mean u^2 + v^2) = 2/n sum_t [C_uu^2 + C_vv^2 + 2 C_uv^2],   Var(mean u v) = 1/n sum_t [C_uu C_vv +
//   C_uv(t) C_uv(-t)]
// (Isserlis); independent places leave only t = 0. For exp(-r^2/l^2) on a patch L x L this gives n_eff = 8
// L^2 / (3 pi l^2) an axis.
//
// By Parseval the sums over lags are sums over wavenumbers of products of spectra. The raw periodogram would
// count every square twice (its values scatter like an exponential: E P^2 = 2 (E P)^2), and summing measured
// correlations over all lags is the same thing in disguise. So spectra are averaged over 3 x 3 neighbours,
// which is a window over lags of a third of the patch, and the scatter that is left, one ninth, is taken off.
#include "fitting/effective_size.h"

#include <complex>
#include <unsupported/Eigen/FFT>

namespace gonio {
namespace {

using Complex = std::complex<float>;

// Largest size up to n without prime factors above 5: others cost the transform their square.
int smooth_size(int n) {
    auto is_smooth = [](int k) {
        for (const int p : {2, 3, 5})
            while (k % p == 0) k /= p;
        return k == 1;
    };
    while (!is_smooth(n)) --n;
    return n;
}

struct Spectrum {
    int nx = 0, ny = 0;
    std::vector<Complex> z;  // transform of u + i v

    const Complex& at(int kx, int ky) const {
        return z[static_cast<size_t>(wrap_index(ky, ny)) * nx + wrap_index(kx, nx)];
    }
};

// Whether the columns (rows) are their own mirror image, as the mirror boundary makes them: the second half
// tells nothing new.
bool is_mirrored(const HeightField& s, bool along_x) {
    const int n = along_x ? s.nx : s.ny, n_across = along_x ? s.ny : s.nx;
    if (n < 2 || n % 2 != 0) return false;
    for (int a = 0; a < n_across; ++a)
        for (int k = 0; k < n / 2; ++k)
            if (along_x ? s.at(k, a) != s.at(n - 1 - k, a) : s.at(a, k) != s.at(a, n - 1 - k)) return false;
    return true;
}

// Differences along the edges of the cells: each is p of one lower and one upper facet, or q of one of each
// kind.
Spectrum slope_spectrum(const HeightField& s, double rotation) {
    Spectrum spectrum;
    spectrum.nx = smooth_size(is_mirrored(s, true) ? s.nx / 2 : s.nx - 2 * s.border_x);
    spectrum.ny = smooth_size(is_mirrored(s, false) ? s.ny / 2 : s.ny - 2 * s.border_y);
    const int nx = spectrum.nx, ny = spectrum.ny;
    std::vector<Complex>& z = spectrum.z;
    z.resize(static_cast<size_t>(nx) * ny);
    const double c = std::cos(rotation), sine = std::sin(rotation);
    for (int j = 0; j < ny; ++j) {
        for (int i = 0; i < nx; ++i) {
            const double h = s.at(s.border_x + i, s.border_y + j);
            const double p = (s.at(s.border_x + i + 1, s.border_y + j) - h) / s.pitch_x;
            const double q = (s.at(s.border_x + i, s.border_y + j + 1) - h) / s.pitch_y;
            z[static_cast<size_t>(j) * nx + i] = {static_cast<float>(c * p + sine * q),
                                                  static_cast<float>(c * q - sine * p)};
        }
    }
    Eigen::FFT<float> fft;
    std::vector<Complex> line, transform;
    auto transform_lines = [&](int n_lines, int n, size_t line_stride, size_t stride) {
        line.resize(n);
        transform.resize(n);
        for (int a = 0; a < n_lines && n > 1; ++a) {
            for (int k = 0; k < n; ++k) line[k] = z[a * line_stride + k * stride];
            fft.fwd(transform, line);
            for (int k = 0; k < n; ++k) z[a * line_stride + k * stride] = transform[k];
        }
    };
    transform_lines(ny, nx, nx, 1);
    transform_lines(nx, ny, 1, nx);
    return spectrum;
}

struct Power {
    double uu = 0, vv = 0, uv_re = 0, uv_im = 0;
    Power& operator+=(const Power& p) {
        uu += p.uu, vv += p.vv, uv_re += p.uv_re, uv_im += p.uv_im;
        return *this;
    }
};

// u and v are real, so their transforms part: U = (Z(k) + Z*(-k)) / 2, V = (Z(k) - Z*(-k)) / 2i. The mean (k
// = 0) is no scatter.
Power power(const Spectrum& s, int kx, int ky) {
    if (kx == 0 && ky == 0) return {};
    const std::complex<double> a = s.at(kx, ky), b = std::conj(std::complex<double>(s.at(-kx, -ky)));
    const std::complex<double> u = 0.5 * (a + b), v = std::complex<double>(0, -0.5) * (a - b),
                               uv = u * std::conj(v);
    return {std::norm(u), std::norm(v), uv.real(), uv.imag()};
}

}  // namespace

EffectiveSize effective_size(const HeightField& surface, double rotation) {
    const Spectrum s = slope_spectrum(surface, rotation);
    const int reach_x = s.nx > 2 ? 1 : 0, reach_y = s.ny > 2 ? 1 : 0;
    const double neighbours = (2 * reach_x + 1) * (2 * reach_y + 1);
    const double n = static_cast<double>(s.nx) * s.ny;

    // column[kx]: powers summed over the three rows around ky; then three columns make a neighbourhood.
    std::vector<Power> row_before(s.nx), row(s.nx), row_after(s.nx);
    auto fill = [&](std::vector<Power>& powers, int ky) {
        for (int kx = 0; kx < s.nx; ++kx) powers[kx] = power(s, kx, wrap_index(ky, s.ny));
    };
    fill(row_before, -1);
    fill(row, 0);
    double var_u = 0, var_v = 0, uu2 = 0, vv2 = 0, uv2 = 0, mixed = 0;
    std::vector<Power> column(s.nx);
    for (int ky = 0; ky < s.ny; ++ky) {
        fill(row_after, ky + 1);
        for (int kx = 0; kx < s.nx; ++kx) {
            column[kx] = row[kx];
            if (reach_y) (column[kx] += row_before[kx]) += row_after[kx];
            var_u += row[kx].uu;
            var_v += row[kx].vv;
        }
        for (int kx = 0; kx < s.nx; ++kx) {
            Power mean = column[kx];
            if (reach_x) (mean += column[kx > 0 ? kx - 1 : s.nx - 1]) += column[kx + 1 < s.nx ? kx + 1 : 0];
            uu2 += mean.uu * mean.uu;
            vv2 += mean.vv * mean.vv;
            uv2 += mean.uv_re * mean.uv_re + mean.uv_im * mean.uv_im;
            mixed += mean.uu * mean.vv + mean.uv_re * mean.uv_re - mean.uv_im * mean.uv_im;
        }
        std::swap(row_before, row);
        std::swap(row, row_after);
    }
    // n_eff = n C(0)^2 / sum_t C(t)^2 = (sum_k P)^2 / sum_k P^2: the number of waves that take part.
    const double scatter = neighbours > 1 ? neighbours * neighbours * (1 + 1 / neighbours) : 2;
    auto size = [&](double independent, double correlated) {
        return correlated > 0 ? std::clamp(independent * scatter / correlated, 1.0, n) : n;
    };
    return {.alpha = size(var_u * var_u + var_v * var_v, uu2 + vv2 + 2 * uv2),
            .alpha_x = size(var_u * var_u, uu2),
            .alpha_y = size(var_v * var_v, vv2),
            .rotation = size(var_u * var_v, mixed)};
}

}  // namespace gonio
