#pragma once

#include <cstddef>
#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {

/// A roll-out that ended because a particle's stencil left the grid or its position was no longer
/// finite: the message for the user, and the same as numbers for programs that chart failures.
class LostParticle : public Error {
 public:
  LostParticle(const std::string& message, std::ptrdiff_t particle, std::ptrdiff_t step)
      : Error(message), particle_(particle), step_(step) {}
  std::ptrdiff_t particle() const { return particle_; }  ///< row of the state
  std::ptrdiff_t step() const { return step_; }          ///< after which it was lost

 private:
  std::ptrdiff_t particle_, step_;
};

}  // namespace uniphy::kernels
