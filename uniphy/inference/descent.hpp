#pragma once

#include <torch/types.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace torch::optim {
class Optimizer;
}

namespace uniphy {

struct DescentOptions {
  std::string method = "lbfgs";  ///< lbfgs or adamw, both Torch's own
  double rate = 0.1;             ///< length of the first step; adamw: step of a coordinate at first
  int epochs = 20;   ///< evaluations that may be made; adamw's rate falls along a cosine to 1 %
  double clip = 10;  ///< adamw: longest gradient, in multiples of the running mean of their lengths
  int patience = 8;  ///< evaluations that gain less than 1 % before it ends
};

/// A torch::optim::Optimizer on its way down from a point, with what a fit needs beside it: a
/// budget of evaluations, the best point, a way back from where there is no loss, and a state that
/// goes on to the same bits.
///
/// - adamw: torch::optim::AdamW, β = 0.9, 0.99 for the few epochs of a fit, no decay of weights
/// (the
///   prior is a term of the loss). After an evaluation without loss it goes on from the best point
///   with half the rate and new moments.
/// - lbfgs: torch::optim::LBFGS with strong Wolfe line search, one iteration a step, which may take
///   several evaluations. The loss is scaled by its first gradient, since Torch ignores curvature
///   yᵀs below 1e-10. Torch evaluates the point where the last step ended once more: it is handed
///   what is known of it. Its line search turns an infinite loss into parameters that are NaN; in
///   its place it gets the height that makes its cubic go back to a quarter of the way.
class Descent {
 public:
  /// Computes the loss [] and the gradient of the leaves, in their .grad(). A loss that is not
  /// finite means that there is none (the roll-out failed); the gradients are not read then.
  using Closure = std::function<torch::Tensor()>;

  /// The leaves, float64 with requires_grad, are moved in place. Throws Error where the method is
  /// unknown.
  Descent(const DescentOptions& options, std::vector<torch::Tensor> leaves);
  ~Descent();

  /// Whether the budget or the patience is used up, or there is nowhere left to go.
  bool done() const;
  /// One step of the optimizer. Calls the closure once or more, and never beyond done().
  void step(const Closure& closure);
  int evaluations() const { return evaluations_; }
  const std::vector<torch::Tensor>& leaves() const { return leaves_; }
  /// Where the lowest loss was found, and that loss, infinite where none was.
  const std::vector<torch::Tensor>& best() const { return best_; }
  double best_loss() const { return best_loss_; }

  /// Everything that the next steps depend on, as the bytes of a Torch archive; load() continues to
  /// the same bits. Throws Error where they belong to leaves of another shape or are damaged.
  std::string save() const;
  void load(const std::string& bytes);
  /// Takes over the curvature that the save() of an earlier one of the same method has found;
  /// adamw, whose moments have the size of the old loss, takes nothing.
  void inherit(const std::string& bytes);

 private:
  /// A point that has been evaluated.
  struct Point {
    std::vector<torch::Tensor> leaves, gradient;
    double loss = 0;  ///< as the optimizer sees it
  };

  bool lbfgs() const { return options_.method == "lbfgs"; }
  void make_optimizer();
  void set_rate();
  torch::Tensor evaluate(const Closure& closure);
  void count(double loss);
  torch::Tensor stand_in();
  void clip_gradient();
  void step_back();
  const Point* point_here(const std::vector<Point>& points) const;
  Point here(double loss) const;

  DescentOptions options_;
  std::vector<torch::Tensor> leaves_;
  std::unique_ptr<torch::optim::Optimizer> optimizer_;
  int evaluations_ = 0, stalled_ = 0;
  bool ended_ = false;
  double best_loss_, reference_;  ///< reference: loss of which the next 1 % have not been gained
  std::vector<torch::Tensor> best_;
  double damping_ = 1;            ///< adamw: of the rate, halved where there was no loss
  double mean_length_ = -1;       ///< adamw: of the gradients; −1: none yet
  double scale_ = 0;              ///< lbfgs: of the loss; 0: not known yet
  std::vector<Point> known_;      ///< lbfgs: where the last step ended
  std::vector<Point> evaluated_;  ///< lbfgs: in this step
};

}  // namespace uniphy
