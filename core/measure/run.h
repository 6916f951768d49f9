// One randomised run of the fast engine: a complete, unbiased table from one random shift of everything that
// is shared. Independent runs give the mean and its standard error (Cranley-Patterson; design 3.3).
#pragma once
#include <initializer_list>
#include <string>
#include <vector>

#include "base/monitor.h"
#include "material/material.h"
#include "measure/plan.h"
#include "measure/scene.h"
#include "scattering/diffuse.h"
#include "scattering/irradiance.h"

namespace gonio {

// What the runs of a job by the diffuse operator share.
struct RunContext : MeasuredScene {
    const Lambertian* lambertian = nullptr;  // its albedo with a value or a plane for each channel
    bool indirect = true;                    // false: black, or too gentle for light to be scattered twice
    bool keep_orders = false;  // single orders are wanted, or summing them first is not to be tried
    int max_order = 0;
    double series_tolerance = 1e-4;
    int fixed_applications = 0;
    int single_orders =
        0;  // slices of single orders to keep; 0: as many as the series gives, if the table wants them
    bool keep_first = false;  // RunValues::first, for the noise bias

    bool transports() const { return indirect && max_order != 1; }
};

struct RunSettings {
    int sub_samples = 1;  // points per facet part for the direct term
    int directions = 64;  // shared directions of the operator
    int refinement = 1;
    int tiles_x = 0, tiles_y = 0;  // windows per run; 0: the whole period at once
    int block_step = 1;            // forward tracing starts from one of so many blocks of cells
    bool operator==(const RunSettings&) const = default;
};

struct RunValues {
    int higher_orders = 0;  // single orders kept beyond the first
    int applications = 0;
    double ratio = 0, remainder = 0;  // largest, see OrderSeries
    double turn = 0;                  // on a curved base: rms turn of the frame along links, radians
    double heaviest = 0;              // largest, see GraphOrders
    // f in 1/sr, [channel][slice][row]; slices as in Table: 0 the sum, then single orders if they are kept
    // apart for the table.
    std::vector<float> f;
    // The first order alone, [row]: per unit of a constant albedo, else of a map's channel 0. Tells which
    // part of the error dominates.
    std::vector<float> direct;
    // Sampled over true projected area (exactly 1 for a whole period), per light and view: far from 1 where
    // no sample met the slivers that are lit.
    std::vector<float> projected_lights, projected_views;
    // If asked for: the irradiance g of the first block of transported directions, and K g, over the whole
    // period.
    Fields first_irradiance, first;
    double rays = 0, rays_skipped = 0, links = 0, substituted = 0, dropped = 0;
    int truncated_bundles = 0;
    double seconds_direct = 0, seconds_links = 0, seconds_series = 0;  // CPU of the calling threads
};

// run: number of the run inside its stage; (seed, stage, run) key its random numbers.
RunValues run_once(const RunContext& context, const RunSettings& settings, int stage, int run, int n_threads,
                   const Monitor& monitor);

// Names what decides the bits of a run beside the job, the stage and the number of the run: the transport,
// its settings, and `beside` them what else it decided. Equal for jobs that may have the run in common; 16
// hex digits.
std::string settings_key(TransportKind transport, const RunSettings& settings,
                         std::initializer_list<double> beside);

// The random shifts of one run, in [0, 1): 0, 1 window position; 2, 3 sub-samples; 4, 5 direction lattice; 6,
// 7 jitter; then what a transport needs beside.
class RunShifts {
  public:
    RunShifts(uint64_t seed, int stage, int run);
    double operator()(int which) const;

  private:
    uint64_t seed_, stream_;
};

// CPU time of the calling thread.
double thread_seconds();

// n places inside the facets: the R2 sequence (Roberts 2018) from a random start.
std::vector<SubSample> shifted_sub_samples(int n, double shift_a, double shift_b);

// Working memory of one run that cannot be split further, bytes.
double run_bytes(const RunContext& context, const RunSettings& settings, int n_lights, int n_views);

}  // namespace gonio
