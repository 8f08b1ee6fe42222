#include "uniphy/inference/candidate_fit.hpp"

#include <torch/serialize.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <utility>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/descent.hpp"
#include "uniphy/inference/levenberg_marquardt.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

class GradientFit : public CandidateFit {
 public:
  GradientFit(const FitProblem& problem, const FitCandidate& from, int stage,
              const FitOptions& options)
      : problem_(problem),
        stage_(stage),
        descent_(settings(options, stage), problem.leaves(from, stage)) {}

  bool done() const override { return descent_.done(); }
  int roll_outs() const override { return descent_.evaluations(); }
  std::string save() const override { return descent_.save(); }
  void load(const std::string& bytes) override { descent_.load(bytes); }
  void inherit(const std::string& bytes) override { descent_.inherit(bytes); }

  void step(FitCandidate& best, const std::function<void(double)>& on_roll_out) override {
    descent_.step([&] {
      const FitProblem::Evaluation at = problem_.evaluate(descent_.leaves(), stage_);
      on_roll_out(at.mse);
      if (const double loss = at.loss.item<double>(); loss < best.loss) {
        best.loss = loss;
        best.mse = at.mse;
        best.u = descent_.leaves()[0].detach().clone();
        if (descent_.leaves().size() > 1) best.motion = descent_.leaves()[1].detach().clone();
      }
      return at.loss;
    });
  }

 private:
  static DescentOptions settings(const FitOptions& options, int stage) {
    const FitStage& now = options.stages[stage];
    return {now.optimizer, now.rate, now.epochs, options.clip, options.patience};
  }
  const FitProblem& problem_;
  int stage_;
  Descent descent_;
};

class LeastSquaresFit : public CandidateFit {
 public:
  LeastSquaresFit(const FitProblem& problem, const FitCandidate& from, int stage,
                  const FitOptions& options)
      : problem_(problem),
        stage_(stage),
        iterations_(options.stages[stage].epochs),
        start_(point_of(from)),
        pull_(kFirstPull * std::pow(kPullOfHorizons, stage)),
        optimizer_({start_.clone()}, LevenbergMarquardtOptions()) {}

  bool done() const override { return ended_ || steps_ >= iterations_; }
  int roll_outs() const override { return optimizer_.evaluations(); }

  void step(FitCandidate& best, const std::function<void(double)>& on_roll_out) override {
    const int before = optimizer_.evaluations();
    const double loss = optimizer_.loss();
    const double now = optimizer_
                           .step([&](const Tensor& point) {
                             const Tensor r = problem_.residuals(point, problem_.frames(stage_));
                             return r.defined() ? torch::cat({r, pull_ * (point - start_)}) : r;
                           })
                           .item<double>();
    ++steps_;
    const bool settled = optimizer_.stuck() || !(now < (1 - kLittleGain) * loss);
    const Tensor point = optimizer_.point();
    const double without = now - pull_ * pull_ * (point - start_).square().sum().item<double>();
    if (without < best.loss) {
      best.loss = without;
      best.u = point.slice(0, 0, problem_.variables().size()).clone();
      if (point.numel() > best.u.numel()) best.motion = point.slice(0, best.u.numel()).clone();
      best.mse = problem_.mse_of(best.loss, best.u);
    }
    for (int k = before; k < optimizer_.evaluations(); ++k) on_roll_out(best.mse);
    const bool last = stage_ + 1 == problem_.stages();
    const double least = problem_.least_pull(problem_.frames(stage_));
    ended_ = settled && !(last && pull_ > least);
    if (!settled || ended_) return;
    pull_ = std::max(kPullOfFits * pull_, least);
    optimizer_.forget_residuals();
  }

  std::string save() const override {
    torch::serialize::OutputArchive archive;
    archive.write("steps", torch::tensor({std::int64_t(steps_), std::int64_t(ended_)}));
    archive.write("pull", torch::tensor({pull_}, torch::kFloat64));
    archive.write("start", start_);
    std::ostringstream bytes;
    archive.save_to(bytes);
    const std::string own = bytes.str(), of_optimizer = optimizer_.saved();
    return std::to_string(own.size()) + "\n" + own + of_optimizer;
  }
  void load(const std::string& bytes) override {
    const std::size_t line = bytes.find('\n');
    std::size_t size = 0;
    if (line == std::string::npos || line > 12 ||
        (size = std::strtoul(bytes.c_str(), nullptr, 10)) > bytes.size() - line - 1) {
      throw Error("state of the optimizer: expected that of levenberg_marquardt");
    }
    Tensor steps, start, pull;
    try {
      torch::serialize::InputArchive archive;
      std::istringstream stream(bytes.substr(line + 1, size));
      archive.load_from(stream);
      archive.read("steps", steps);
      archive.read("start", start);
      archive.read("pull", pull);
    } catch (const std::exception& error) {  // of Torch, with a trace of calls after the first line
      const std::string text = error.what();
      throw Error("state of the optimizer: " + text.substr(0, text.find('\n')));
    }
    if (start.sizes() != start_.sizes()) {
      throw Error("state of the optimizer: expected " + std::to_string(start_.numel()) +
                  " numbers, found " + std::to_string(start.numel()));
    }
    start_ = start;
    pull_ = pull.item<double>();
    steps_ = static_cast<int>(steps[0].item<std::int64_t>());
    ended_ = steps[1].item<std::int64_t>() != 0;
    optimizer_.resume(bytes.substr(line + 1 + size));
  }
  void inherit(const std::string&) override {}

 private:
  /// Share of the loss that an iteration has to take away for another one.
  static constexpr double kLittleGain = 0.01;

  Tensor point_of(const FitCandidate& from) const {
    if (!problem_.with_velocity(stage_)) return from.u.clone();
    return torch::cat({from.u, from.motion});
  }

  const FitProblem& problem_;
  int stage_, iterations_;
  Tensor start_;
  double pull_;
  LevenbergMarquardt optimizer_;
  int steps_ = 0;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<CandidateFit> make_candidate_fit(const FitProblem& problem,
                                                 const FitCandidate& from, int stage,
                                                 const FitOptions& options) {
  if (options.stages[stage].optimizer == kLevenbergMarquardt)
    return std::make_unique<LeastSquaresFit>(problem, from, stage, options);
  return std::make_unique<GradientFit>(problem, from, stage, options);
}

}  // namespace uniphy
