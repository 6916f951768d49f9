// Ctrl-C: the first asks the work to stop cleanly, the second ends the program at once.
#pragma once
#include <atomic>

namespace gonio {

// For SIGINT and SIGTERM.
void install_interrupt_handlers();

// Set by the first signal; what Monitor::cancel_requested points to.
const std::atomic<bool>& interrupt_requested();

// 130 after SIGINT, 5 after SIGTERM or a cancellation from elsewhere.
int cancelled_exit_code();

}  // namespace gonio
