#pragma once

#include <memory>
#include <string>
#include <vector>

namespace uniphy {

struct OptimizerOptions {
  std::string method = "bfgs";  ///< bfgs or adam
  double rate = 0.1;  ///< adam: step of a coordinate at first; bfgs: length of the first step
  int epochs = 20;    ///< evaluations that will be made; adam's rate falls along a cosine to 1 %
  double clip = 10;   ///< adam: longest gradient, in multiples of the running mean of their lengths
};

/// Unconstrained minimisation that is told one evaluation at a time, so that a fit can stop and go
/// on anywhere: ask() says where, tell() what was found there. A loss that is not finite means that
/// there is none (the roll-out failed); the gradient is not read then.
class Optimizer {
 public:
  virtual ~Optimizer() = default;
  virtual std::vector<double> ask() const = 0;
  virtual void tell(double loss, const std::vector<double>& gradient) = 0;
  /// Everything that the next calls depend on; unpack() continues to the same bits.
  virtual std::vector<double> pack() const = 0;
  virtual void unpack(const std::vector<double>& state) = 0;
  /// Takes over what the pack() of an earlier optimizer with the same options but for the loss
  /// knows of the shape of the problem; nothing where the sizes differ.
  virtual void inherit(const std::vector<double>& state) = 0;
};

/// Adam (Kingma and Ba 2015, β = 0.9, 0.99 for the few epochs of a fit) with a cosine schedule.
/// After a failed evaluation it goes on from the best point with half the rate.
///
/// BFGS (Nocedal and Wright, Numerical Optimization, 6.1) on the inverse Hessian, dense because
/// latents are short, with backtracking to the Armijo condition: half the step or the minimum of
/// the parabola; a quarter where the evaluation failed. Steps are at most ten times `rate` long.
/// When the line search has failed eight times it starts again along the gradient.
std::unique_ptr<Optimizer> make_optimizer(const OptimizerOptions& options,
                                          const std::vector<double>& start);

}  // namespace uniphy
