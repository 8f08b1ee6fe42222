#include "uniphy/inference/levenberg_marquardt.hpp"

#include <torch/optim.h>
#include <torch/serialize.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>
#include <utility>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/for_each.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Dampings that are tried at once, in multiples of the one that served last.
constexpr std::array<double, LevenbergMarquardt::kTrials> kMultiples{1e-2, 1e-1, 1, 10};
/// Share of the gain that the linear model predicts from which a step is as good as it says.
constexpr double kGoodGain = 0.25;
/// Of what a trial has gained: the least that one more step of it gains, for another.
constexpr double kWorthwhile = 0.1;
/// How often the damping grows by kGrowth before a step is given up.
constexpr int kRounds = 3;
constexpr double kGrowth = 1e4;
/// Beyond these a damping means no step, or none at all, to double precision.
constexpr double kLeastDamping = 1e-12, kLargestDamping = 1e8;

using ConstVector = Eigen::Map<const Eigen::VectorXd>;

ConstVector vector_of(const Tensor& t) { return {t.data_ptr<double>(), t.numel()}; }

/// −(A + damping I)⁻¹ g.
Eigen::VectorXd damped_step(Eigen::MatrixXd A, const Eigen::VectorXd& g, double damping) {
  A.diagonal().array() += damping;
  return -Eigen::LDLT<Eigen::MatrixXd>(A).solve(g);
}

/// J + Σ m cᵀ, with what is added kept apart: a Jacobian may be hundreds of megabytes.
class MendedJacobian {
 public:
  MendedJacobian(const Eigen::MatrixXd& J, Eigen::MatrixXd A) : J_(J), A_(std::move(A)) {}

  const Eigen::MatrixXd& normal() const { return A_; }
  Eigen::VectorXd transposed_times(const Eigen::VectorXd& r) const {
    Eigen::VectorXd g(J_.cols());
    for (Eigen::Index i = 0; i < g.size(); ++i) g[i] = J_.col(i).dot(r);
    for (const auto& [m, c] : added_) g += m.dot(r) * c;
    return g;
  }
  Eigen::VectorXd times(const Eigen::VectorXd& step) const {
    Eigen::VectorXd r = J_ * step;
    for (const auto& [m, c] : added_) r += c.dot(step) * m;
    return r;
  }
  void add(Eigen::VectorXd m, Eigen::VectorXd c) {
    const Eigen::VectorXd g = transposed_times(m);
    A_ += g * c.transpose() + c * g.transpose() + m.squaredNorm() * c * c.transpose();
    added_.emplace_back(std::move(m), std::move(c));
  }

 private:
  const Eigen::MatrixXd& J_;
  Eigen::MatrixXd A_;  ///< the product of its transpose with it
  std::vector<std::pair<Eigen::VectorXd, Eigen::VectorXd>> added_;
};

Tensor moved(const Tensor& point, const Eigen::VectorXd& step) {
  Tensor result = point.clone();
  for (Eigen::Index k = 0; k < step.size(); ++k) result.data_ptr<double>()[k] += step[k];
  return result;
}

}  // namespace

LevenbergMarquardt::LevenbergMarquardt(std::vector<Tensor> leaves,
                                       const LevenbergMarquardtOptions& options)
    : Optimizer({torch::optim::OptimizerParamGroup(std::move(leaves))},
                std::make_unique<LevenbergMarquardtOptions>(options)),
      loss_(kInfinity),
      damping_(options.damping()) {}

const LevenbergMarquardtOptions& LevenbergMarquardt::options() const {
  return static_cast<const LevenbergMarquardtOptions&>(defaults());
}

Tensor LevenbergMarquardt::point() const {
  std::vector<Tensor> parts;
  for (const Tensor& leaf : param_groups()[0].params()) parts.push_back(leaf.detach().flatten());
  return torch::cat(parts);
}

void LevenbergMarquardt::move_to(const Tensor& point) {
  const torch::NoGradGuard no_grad;
  std::int64_t at = 0;
  for (Tensor& leaf : param_groups()[0].params()) {
    leaf.copy_(point.slice(0, at, at + leaf.numel()).view_as(leaf));
    at += leaf.numel();
  }
}

void LevenbergMarquardt::forget_residuals() {
  residuals_ = Tensor();
  loss_ = kInfinity;
}

Tensor LevenbergMarquardt::step(LossClosure) {
  throw Error("Levenberg-Marquardt: expected a closure that gives residuals, found one of a loss");
}

Tensor LevenbergMarquardt::step(const Residuals& residuals) {
  const torch::NoGradGuard no_grad;
  if (!residuals_.defined()) {
    residuals_ = residuals(point());
    if (!std::isfinite(loss_)) ++evaluations_;  // else it is known from before an interruption
    loss_ = sum_of_squares(residuals_);
  }
  stuck_ = true;
  gained_ = 0;
  if (std::isfinite(loss_) && loss_ > 0) {
    const Tensor here = point();
    std::vector<std::int64_t> columns(static_cast<std::size_t>(here.numel()));
    std::iota(columns.begin(), columns.end(), std::int64_t{0});
    const DifferenceJacobian slopes =
        difference_jacobian(residuals, here, residuals_, columns, options().difference());
    evaluations_ += slopes.evaluations;
    const Trial best = best_trial(residuals, slopes.J);
    if (best.loss < loss_) {
      gained_ = loss_ - best.loss;
      move_to(best.point);
      residuals_ = best.residuals;
      loss_ = best.loss;
      damping_ = std::max(best.damping, kLeastDamping);
      stuck_ = false;
    }
  }
  return torch::scalar_tensor(loss_, torch::kFloat64);
}

LevenbergMarquardt::Trial LevenbergMarquardt::trial(const Residuals& residuals,
                                                    const Eigen::MatrixXd& slopes,
                                                    const Eigen::MatrixXd& normal,
                                                    double damping) const {
  MendedJacobian J(slopes, normal);
  Trial best;
  best.loss = kInfinity;
  Tensor at = point(), r = residuals_;
  double loss = loss_;
  for (int k = 0; k < kTrialSteps; ++k) {
    const Eigen::VectorXd g = J.transposed_times(vector_of(r));
    const Eigen::VectorXd step = damped_step(J.normal(), g, damping);
    if (k == 0) best.predicted = -(2 * g.dot(step) + step.dot(J.normal() * step));
    if (!step.allFinite() || step.isZero(0)) break;
    at = moved(at, step);
    const Tensor next = residuals(at);
    ++best.evaluations;
    const double after = sum_of_squares(next);
    if (after < best.loss) {
      best.point = at;
      best.residuals = next;
      best.loss = after;
    }
    const bool off = k == 0 && std::isfinite(after) && !(after < loss);  // off the valley, perhaps
    const bool worthwhile = loss - after > kWorthwhile * std::max(0.0, loss_ - after);
    if (!off && !worthwhile) break;
    const Eigen::VectorXd missed = vector_of(next) - vector_of(r) - J.times(step);
    J.add(missed, 2 / step.squaredNorm() * step);
    r = next;
    loss = after;
  }
  return best;
}

LevenbergMarquardt::Trial LevenbergMarquardt::best_trial(const Residuals& residuals,
                                                         const Eigen::MatrixXd& J) {
  const Eigen::MatrixXd A = normal_matrix(J);
  const double largest = A.diagonal().maxCoeff();
  Trial best;
  best.loss = kInfinity;
  if (!(largest > 0)) return best;
  for (int round = 0; round < kRounds; ++round) {
    std::array<Trial, kTrials> trials;
    kernels::for_each(static_cast<std::ptrdiff_t>(trials.size()), [&](std::ptrdiff_t i) {
      const torch::NoGradGuard no_grad;
      const double damping = kMultiples[i] * damping_;
      trials[i] = trial(residuals, J, A, damping * largest);
      trials[i].damping = damping;
    });
    for (const Trial& trial : trials) {
      evaluations_ += trial.evaluations;
      if (trial.loss < best.loss) best = trial;
    }
    const auto good = std::find_if(trials.begin(), trials.end(), [&](const Trial& trial) {
      return trial.loss < loss_ && loss_ - trial.loss >= kGoodGain * trial.predicted;
    });
    if (good != trials.end()) best = *good;
    if (best.loss < loss_ || damping_ > kLargestDamping) break;
    damping_ *= kGrowth;
  }
  return best;
}

std::string LevenbergMarquardt::saved() const {
  torch::serialize::OutputArchive archive;
  archive.write("numbers", torch::tensor({damping_, double(evaluations_), double(stuck_), loss_},
                                         torch::kFloat64));
  archive.write("point", point());
  std::ostringstream bytes;
  archive.save_to(bytes);
  return bytes.str();
}

void LevenbergMarquardt::resume(const std::string& bytes) {
  Tensor numbers, there;
  try {
    torch::serialize::InputArchive archive;
    std::istringstream stream(bytes);
    archive.load_from(stream);
    archive.read("numbers", numbers);
    archive.read("point", there);
  } catch (const std::exception& error) {  // of Torch, with a trace of calls after the first line
    const std::string text = error.what();
    throw Error("state of the optimizer: " + text.substr(0, text.find('\n')));
  }
  const Tensor here = point();
  if (there.sizes() != here.sizes() || numbers.numel() != 4) {
    throw Error("state of the optimizer: expected " + std::to_string(here.numel()) +
                " numbers, found " + std::to_string(there.numel()));
  }
  move_to(there);
  damping_ = numbers[0].item<double>();
  evaluations_ = static_cast<int>(numbers[1].item<double>());
  stuck_ = numbers[2].item<double>() != 0;
  loss_ = numbers[3].item<double>();
  residuals_ = Tensor();
}

}  // namespace uniphy
