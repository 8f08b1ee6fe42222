#pragma once

#include "ops/kernels/error.hpp"

namespace uniphy {

/// The user asked the program to stop (SIGINT, SIGTERM).
class Interrupted : public Error {
 public:
  Interrupted();
};

/// From now on the first SIGINT or SIGTERM only sets a flag, so that the program can save what it
/// has; the second one ends it at once.
void catch_interrupts();
bool interrupt_requested();
/// Throws Interrupted where a signal came. Files being written are dropped on the way out, finished
/// ones stay.
void throw_if_interrupted();

}  // namespace uniphy
