#include "uniphy/inference/descent.hpp"

#include <torch/optim.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Ends a line search whose budget is used up.
struct OutOfBudget {};

std::vector<Tensor> copies(const std::vector<Tensor>& tensors) {
  std::vector<Tensor> result;
  for (const Tensor& t : tensors) result.push_back(t.detach().clone());
  return result;
}

Tensor flat_gradient(const std::vector<Tensor>& leaves) {
  std::vector<Tensor> parts;
  for (const Tensor& leaf : leaves) parts.push_back(leaf.grad().flatten());
  return torch::cat(parts);
}

Tensor number(double x) { return torch::scalar_tensor(x, torch::kFloat64); }

}  // namespace

Descent::Descent(const DescentOptions& options, std::vector<Tensor> leaves)
    : options_(options),
      leaves_(std::move(leaves)),
      best_loss_(kInfinity),
      reference_(kInfinity),
      best_(copies(leaves_)) {
  make_optimizer();
}

Descent::~Descent() = default;

void Descent::make_optimizer() {
  if (options_.method == "adamw") {
    // Gradients of mse/size² may be as small as Torch's own eps.
    optimizer_ = std::make_unique<torch::optim::AdamW>(
        leaves_,
        torch::optim::AdamWOptions(options_.rate).betas({0.9, 0.99}).eps(1e-30).weight_decay(0));
  } else if (lbfgs()) {
    // One iteration a step, so that the fit can stop and go on between them. Tolerances are zero:
    // patience ends a descent. The history outlives the horizon's growth; Torch's default of 100
    // keeps what an earlier horizon has found for too long (plasticine, uniphy_identify with seed
    // 33: 1.2e-11 m² in place of 3e-13).
    optimizer_ =
        std::make_unique<torch::optim::LBFGS>(leaves_, torch::optim::LBFGSOptions(options_.rate)
                                                           .max_iter(1)
                                                           .max_eval(options_.epochs)
                                                           .tolerance_grad(0)
                                                           .tolerance_change(0)
                                                           .history_size(20)
                                                           .line_search_fn("strong_wolfe"));
  } else {
    throw Error("optimizer: expected adamw or lbfgs, found \"" + options_.method + "\"");
  }
}

bool Descent::done() const {
  return ended_ || evaluations_ >= options_.epochs || stalled_ >= options_.patience;
}

void Descent::step(const Closure& closure) {
  const int before = evaluations_;
  set_rate();
  evaluated_.clear();
  try {
    optimizer_->step([&] { return evaluate(closure); });
  } catch (const OutOfBudget&) {
  }
  if (evaluations_ == before || !std::isfinite(best_loss_)) ended_ = true;
  if (lbfgs()) {
    const Point* end = point_here(evaluated_);
    known_ = end != nullptr ? std::vector<Point>{*end} : std::vector<Point>{};
  } else if (!leaves_[0].grad().defined()) {
    step_back();
  }
}

/// adamw: along a cosine. lbfgs: Torch begins with rate/|g|₁ times the gradient and then tries the
/// full quasi-Newton step.
void Descent::set_rate() {
  torch::optim::OptimizerOptions& options = optimizer_->param_groups()[0].options();
  if (!lbfgs()) {
    const double share = std::min(1.0, evaluations_ / std::max(1.0, options_.epochs - 1.0));
    static_cast<torch::optim::AdamWOptions&>(options).lr(
        options_.rate * damping_ * (0.01 + 0.99 * 0.5 * (1 + std::cos(M_PI * share))));
  } else {
    const bool first = scale_ == 0;
    static_cast<torch::optim::LBFGSOptions&>(options).lr(first ? options_.rate : 1);
  }
}

Tensor Descent::evaluate(const Closure& closure) {
  if (const Point* known = point_here(known_); known != nullptr) {
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      leaves_[i].mutable_grad() = known->gradient[i].clone();
    }
    evaluated_.push_back(*known);
    return number(known->loss);
  }
  if (done()) throw OutOfBudget();
  Tensor loss = closure().detach();
  const double value = loss.item<double>();
  count(value);
  if (!std::isfinite(value)) {
    for (Tensor& leaf : leaves_) leaf.mutable_grad() = Tensor();
    return lbfgs() ? stand_in() : loss;  // adamw passes over undefined gradients
  }
  if (!lbfgs()) {
    clip_gradient();
    return loss;
  }
  if (scale_ == 0) {
    const double length = flat_gradient(leaves_).abs().sum().item<double>();
    scale_ = length > 0 ? 1 / length : 1;
  }
  for (Tensor& leaf : leaves_) leaf.mutable_grad().mul_(scale_);
  evaluated_.push_back(here(scale_ * value));
  return number(scale_ * value);
}

void Descent::count(double loss) {
  ++evaluations_;
  if (loss < best_loss_) {
    best_loss_ = loss;
    best_ = copies(leaves_);
  }
  if (best_loss_ < 0.99 * reference_) {
    reference_ = best_loss_;
    stalled_ = 0;
  } else {
    ++stalled_;
  }
}

/// A height without slope at the end of a step of length t that began with slope −g: the cubic
/// through it has its minimum at t/4 where it lies g t/6 above the beginning.
Tensor Descent::stand_in() {
  if (evaluated_.empty()) throw OutOfBudget();  // nowhere to go back to
  const Point& start = evaluated_.front();
  double slope = 0;
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    slope += (start.gradient[i] * (leaves_[i].detach() - start.leaves[i])).sum().item<double>();
    leaves_[i].mutable_grad() = torch::zeros_like(leaves_[i]);
  }
  return number(start.loss + std::abs(slope) / 6);
}

void Descent::clip_gradient() {
  const double length = flat_gradient(leaves_).norm().item<double>();
  double kept = length;
  if (mean_length_ >= 0 && length > options_.clip * mean_length_) {
    kept = options_.clip * mean_length_;
    for (Tensor& leaf : leaves_) leaf.mutable_grad().mul_(kept / length);
  }
  mean_length_ = mean_length_ < 0 ? length : 0.8 * mean_length_ + 0.2 * kept;
}

void Descent::step_back() {
  torch::NoGradGuard no_grad;
  for (std::size_t i = 0; i < leaves_.size(); ++i) leaves_[i].copy_(best_[i]);
  damping_ *= 0.5;
  make_optimizer();
}

const Descent::Point* Descent::point_here(const std::vector<Point>& points) const {
  for (const Point& point : points) {
    bool same = true;
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      same = same && torch::equal(point.leaves[i], leaves_[i]);
    }
    if (same) return &point;
  }
  return nullptr;
}

Descent::Point Descent::here(double loss) const {
  Point point{copies(leaves_), {}, loss};
  for (const Tensor& leaf : leaves_) point.gradient.push_back(leaf.grad().clone());
  return point;
}

}  // namespace uniphy
