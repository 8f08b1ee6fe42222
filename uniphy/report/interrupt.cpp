#include "uniphy/report/interrupt.hpp"

#include <unistd.h>

#include <csignal>

namespace uniphy {
namespace {

volatile std::sig_atomic_t interrupted = 0;

void on_signal(int) {
  interrupted = 1;
  static const char message[] =
      "\ninterrupted: stopping at the next step; once more to stop at once\n";
  // Nothing but write() is allowed here, and a closed stderr is no reason to do otherwise.
  [[maybe_unused]] const auto ignored = ::write(STDERR_FILENO, message, sizeof message - 1);
}

}  // namespace

Interrupted::Interrupted() : Error("interrupted; finished files are kept") {}

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  // SA_RESETHAND: the second signal finds the default action, which ends the program.
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool interrupt_requested() { return interrupted != 0; }

void throw_if_interrupted() {
  if (interrupted != 0) throw Interrupted();
}

}  // namespace uniphy
