// What people see: everything but data goes to stderr.
#pragma once
#include <chrono>
#include <iosfwd>
#include <string>

#include "base/error.h"
#include "base/monitor.h"
#include "measure/report.h"
#include "server/load_job.h"

namespace gonio {

// "gonio: error: ..." (red on a terminal, unless NO_COLOR is set or TERM is dumb).
void print_error(const std::string& message);
void print_warning(const std::string& message);

// Size, pitch, heights, slopes, seam, notes and warnings.
void print_surface(const LoadedSurface& surface, std::ostream& out);

// Error reached, settings, skipped work and why, counters, times.
void print_report(const Report& report, std::ostream& out);

// Progress on stderr: a bar on a terminal, else a line for every tenth.
class ProgressBar {
  public:
    explicit ProgressBar(bool quiet);
    ~ProgressBar();
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;
    void update(const Progress& progress);

  private:
    using Clock = std::chrono::steady_clock;
    bool quiet_, terminal_, drawn_ = false;
    int tenths_ = 0;
    Clock::time_point start_ = Clock::now(), last_drawn_;
};

}  // namespace gonio
