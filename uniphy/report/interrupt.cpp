#include "uniphy/report/interrupt.hpp"

#include <time.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>

#include "ops/kernels/base/between_steps.hpp"

namespace uniphy {
namespace {

constexpr std::int64_t kPatience = 2;  ///< s

volatile std::sig_atomic_t interrupted = 0;
std::atomic<std::int64_t> interrupted_at{0};  ///< s; lock-free, so that a handler may write it

std::int64_t now() {
  timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);  // allowed in a signal handler, unlike std::chrono
  return t.tv_sec;
}

void throw_if_overdue() {
  if (interrupted != 0 && now() - interrupted_at.load() > kPatience) throw Interrupted();
}

void on_signal(int) {
  interrupted_at = now();
  interrupted = 1;
  static const char message[] =
      "\ninterrupted: stopping at the next step; once more to stop at once\n";
  // Nothing but write() is allowed here, and a closed stderr is no reason to do otherwise.
  [[maybe_unused]] const auto ignored = ::write(STDERR_FILENO, message, sizeof message - 1);
}

}  // namespace

Interrupted::Interrupted() : std::runtime_error("interrupted; finished files are kept") {}

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  // SA_RESETHAND: the second signal finds the default action, which ends the program.
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  kernels::between_steps = throw_if_overdue;
}

bool interrupt_requested() { return interrupted != 0; }

void throw_if_interrupted() {
  if (interrupted != 0) throw Interrupted();
}

}  // namespace uniphy
