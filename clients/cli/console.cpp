#include "clients/cli/console.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <string_view>

#include "base/numeric.h"
#include "base/text.h"
#include "server/lengths.h"

namespace gonio {
namespace {

bool dumb_terminal() {
    const char* term = std::getenv("TERM");
    return !isatty(STDERR_FILENO) || !term || std::string_view(term) == "dumb";
}

bool use_colour() {
    const char* no_color = std::getenv("NO_COLOR");
    return !dumb_terminal() && (!no_color || !*no_color);
}

void print_labelled(const char* label, const char* colour, const std::string& message) {
    std::cerr << "gonio: " << (use_colour() ? colour : "") << label << (use_colour() ? "\033[0m" : "") << ": "
              << message << std::endl;
}

std::string padded(const std::string& label) {
    return "  " + label + std::string(label.size() < 20 ? 20 - label.size() : 1, ' ');
}

std::string slope_text(double slope) {
    return number_text(slope, 3) + " (" + number_text(degrees(std::atan(slope)), 3) + " deg)";
}

}  // namespace

void print_error(const std::string& message) {
    print_labelled("error", "\033[1;31m", message);
}
void print_warning(const std::string& message) {
    print_labelled("warning", "\033[1;33m", message);
}

void print_surface(const LoadedSurface& loaded, std::ostream& out) {
    const SurfaceStatistics& s = loaded.statistics;
    out << loaded.description << "\n"
        << padded("simulated") << s.nx << " x " << s.ny << " points, " << format_length(s.width) << " x "
        << format_length(s.depth) << "\n"
        << padded("pitch") << format_length(s.pitch_x) << " x " << format_length(s.pitch_y) << "\n"
        << padded("heights") << "Sq " << format_length(s.sq) << ", "
        << format_length(s.height_max - s.height_min) << " from lowest to highest\n"
        << padded("slopes") << "rms " << number_text(s.rms_slope_x, 3) << " in x, "
        << number_text(s.rms_slope_y, 3) << " in y; steepest " << slope_text(s.max_slope) << "\n"
        << padded("wrap jump") << number_text(s.wrap_jump_x, 3) << " in x, " << number_text(s.wrap_jump_y, 3)
        << " in y (1 is seamless)\n"
        << padded("correlation length") << format_length(s.correlation_length_x) << " in x, "
        << format_length(s.correlation_length_y) << " in y\n";
    for (const std::string& note : loaded.notes) out << padded("note") << note << "\n";
    for (const std::string& warning : loaded.warnings) out << padded("warning") << warning << "\n";
    out << std::flush;
}

void print_report(const Report& report, std::ostream& out) {
    out << "relative error " << number_text(report.relative_error, 3)
        << (report.target_met ? "" : ", the target was not met") << "\n";
    for (const auto& [what, value] : report.settings) out << padded(what) << value << "\n";
    for (const auto& [what, why] : report.skipped) out << padded("skipped") << what << ": " << why << "\n";
    for (const auto& [what, count] : report.counters) out << padded(what) << number_text(count, 6) << "\n";
    for (const auto& [stage, seconds] : report.seconds) {
        out << padded(stage) << number_text(seconds, 3) << " s\n";
    }
    for (const std::string& warning : report.warnings) out << padded("warning") << warning << "\n";
    out << std::flush;
}

ProgressBar::ProgressBar(bool quiet) : quiet_(quiet), terminal_(!dumb_terminal()) {}

ProgressBar::~ProgressBar() {
    if (drawn_) std::cerr << "\r\033[K" << std::flush;
}

void ProgressBar::update(const Progress& progress) {
    if (quiet_) return;
    const double fraction = std::clamp(progress.fraction, 0.0, 1.0);
    std::string text = std::to_string(static_cast<int>(100 * fraction)) + " %  " + progress.stage;
    if (progress.relative_error > 0) text += ", error " + number_text(progress.relative_error, 2);
    if (!terminal_) {
        // The plan can grow while it runs, and the fraction then falls: each tenth is told once.
        const int tenths = static_cast<int>(10 * fraction);
        if (tenths <= tenths_) return;
        tenths_ = tenths;
        std::cerr << "gonio: " << text << std::endl;
        return;
    }
    const Clock::time_point now = Clock::now();
    if (drawn_ && now - last_drawn_ < std::chrono::milliseconds(100)) return;
    constexpr int width = 30;
    const int filled = static_cast<int>(fraction * width);
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - start_).count();
    std::cerr << "\r\033[K[" << std::string(filled, '#') << std::string(width - filled, ' ') << "] " << text
              << ", " << seconds << " s" << std::flush;
    drawn_ = true;
    last_drawn_ = now;
}

}  // namespace gonio
