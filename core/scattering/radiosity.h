// The light that every facet part sends back: all orders of diffuse scattering summed where they arrive, for
// pictures of the relief (diffuse.h sums them where they are seen, for tables).
//
// Applied twice, a sampled K meets its own noise, and E[K K] is not E[K] E[K]: all orders come out 0.17 % too
// bright with 32 directions a facet part, slope 0.7 and albedo 0.8. So two independent samplings take turns,
// ... K K' K E: every order is then without bias up to the noise that the first and third of three factors
// share. What is scattered once, and most of the noise with it, is K's alone, so K' may have fewer
// directions.
#pragma once
#include <array>
#include <vector>

#include "base/monitor.h"
#include "scattering/gather_operator.h"

namespace gonio {

struct RadiosityOptions {
    int max_order = 0;        // 0: all; K >= 1: scattering orders 1..K (order 1 is light from the lamps)
    double tolerance = 1e-4;  // of what is left out of all orders, relative to the first
    int max_applications = 256;
};

// Of every channel: one number each, or (`maps`) one per slot and channel.
struct FacetAlbedo {
    std::vector<double> constant;
    std::vector<std::vector<float>> maps;

    size_t n_channels() const { return maps.empty() ? constant.size() : maps.size(); }
    double at(size_t channel, size_t slot) const {
        return maps.empty() ? constant[channel] : maps[channel][slot];
    }
};

class Radiosity {
  public:
    // The references must outlive it.
    Radiosity(const Tile& tile, FacetAlbedo albedo, const RadiosityOptions& options, int n_threads,
              const Monitor& monitor);

    // K and K'. Without any there is the first order alone.
    void set_operators(std::array<GatherOperator, 2> operators);

    // albedo E of each channel, [unknown][light]: E is the irradiance of all orders, in units of what a
    // surface that faces the light receives; `irradiance` that of the first. Kept until the next call.
    const std::vector<Fields>& of(const Fields& irradiance);

    const FacetAlbedo& albedo() const { return albedo_; }
    const RadiosityOptions& options() const { return options_; }
    int applications() const { return applications_; }  // of K or K': the most so far
    double remainder() const {
        return remainder_;
    }  // rms of what is left out, relative to the first
       // order: the largest so far

  private:
    template <class Columns>
    struct Room {
        Columns carried, next;
        std::vector<Columns> of_channel;
    };
    template <class Columns>
    void sum(const Columns& irradiance, Room<Columns>& room);
    template <class Columns>
    void add_orders(const std::array<GatherOperator, 2>& operators, const Columns& irradiance,
                    const std::vector<double>& albedos, std::vector<Columns*> sums, Room<Columns>& room);

    const Tile& tile_;
    FacetAlbedo albedo_;
    RadiosityOptions options_;
    int n_threads_;
    const Monitor& monitor_;
    std::vector<std::array<GatherOperator, 2>> operators_;  // one for all channels, or one each
    Room<Fields> room_;
    Room<FewColumns> few_;
    int applications_ = 0;
    double remainder_ = 0;
};

}  // namespace gonio
