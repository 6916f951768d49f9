// Axes: which numbers to write beside them, and where a value stands.
#pragma once
#include <string>
#include <vector>

namespace gonio {

struct Scale {
    double low = 0, high = 1;
    bool is_log = false;
    // 0 at low, 1 at high; values at or below 0 on a logarithmic axis stand at 0.
    double place(double value) const;
};

// Values 1, 2, 5 times powers of ten inside the scale, about `count` of them; powers of ten alone on long
// logarithmic scales.
std::vector<double> ticks(const Scale& scale, int count);

// Short: "0.25", "1e-05" as 10 with a raised exponent.
std::string tick_label(double value);

// Scale that holds all values, rounded outwards to the ticks that `count` asks for.
Scale enclosing_scale(double low, double high, bool is_log, int count = 5);

}  // namespace gonio
