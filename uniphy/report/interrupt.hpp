#pragma once

#include <stdexcept>

namespace uniphy {

/// The user asked the program to stop (SIGINT, SIGTERM). Not an Error: what goes on after the
/// failure of a part of its work must not go on after this.
class Interrupted : public std::runtime_error {
 public:
  Interrupted();
};

/// From now on the first SIGINT or SIGTERM only sets a flag, so that the program can save what it
/// has; the second one ends it at once. Roll-outs that are still running two seconds after the
/// first one throw Interrupted themselves (between_steps.hpp); shorter ones end, so that the work
/// they are part of can be saved.
void catch_interrupts();
bool interrupt_requested();
/// Throws Interrupted where a signal came. Files being written are dropped on the way out, finished
/// ones stay.
void throw_if_interrupted();

}  // namespace uniphy
