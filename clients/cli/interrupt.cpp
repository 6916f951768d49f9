#include "clients/cli/interrupt.h"

#include <unistd.h>

#include <csignal>

namespace gonio {
namespace {

std::atomic<bool> requested{false};
std::atomic<int> received_signal{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

// Only async-signal-safe calls.
void on_signal(int signal) {
    if (requested.exchange(true)) {
        std::signal(signal, SIG_DFL);
        raise(signal);
        return;
    }
    received_signal = signal;
    constexpr char note[] = "\ngonio: stopping, finished results stay; once more to abort\n";
    [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, note, sizeof note - 1);
}

}  // namespace

void install_interrupt_handlers() {
    struct sigaction action = {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

const std::atomic<bool>& interrupt_requested() {
    return requested;
}

int cancelled_exit_code() {
    return received_signal == SIGINT ? 130 : 5;
}

}  // namespace gonio
