#include "uniphy/inference/optimizer.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

using Vector = Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Vector to_eigen(const std::vector<double>& v) {
  return Eigen::Map<const Vector>(v.data(), static_cast<Eigen::Index>(v.size()));
}
std::vector<double> to_std(const Vector& v) { return {v.data(), v.data() + v.size()}; }

/// Numbers and vectors in and out of one flat state.
struct Packer {
  std::vector<double> state;
  void add(double x) { state.push_back(x); }
  void add(const Eigen::MatrixXd& m) { state.insert(state.end(), m.data(), m.data() + m.size()); }
};
struct Unpacker {
  const std::vector<double>& state;
  std::size_t at = 0;
  void get(double& x) { x = state[at++]; }
  template <class M>
  void get_matrix(M& m) {
    std::copy_n(state.begin() + static_cast<std::ptrdiff_t>(at), m.size(), m.data());
    at += static_cast<std::size_t>(m.size());
  }
};

void check_size(const std::vector<double>& state, std::size_t expected) {
  if (state.size() == expected) return;
  throw Error("state of the optimizer: expected " + std::to_string(expected) + " numbers, found " +
              std::to_string(state.size()));
}

class Adam : public Optimizer {
 public:
  Adam(const OptimizerOptions& options, const std::vector<double>& start)
      : options_(options), u_(to_eigen(start)), best_(u_), m_(Vector::Zero(u_.size())), v_(m_) {}

  std::vector<double> ask() const override { return to_std(u_); }

  void tell(double loss, const std::vector<double>& gradient) override {
    ++epoch_;
    if (!std::isfinite(loss)) {
      u_ = best_;
      m_.setZero();
      damping_ *= 0.5;
      return;
    }
    if (loss < best_loss_) {
      best_loss_ = loss;
      best_ = u_;
    }
    Vector g = to_eigen(gradient);
    const double length = g.norm();
    if (told_ > 0 && length > options_.clip * mean_length_) {
      g *= options_.clip * mean_length_ / length;
    }
    mean_length_ = told_ == 0 ? length : 0.8 * mean_length_ + 0.2 * g.norm();
    ++told_;
    m_ = kBeta1 * m_ + (1 - kBeta1) * g;
    v_ = kBeta2 * v_ + (1 - kBeta2) * g.cwiseProduct(g);
    const double share = std::min(1.0, (epoch_ - 1) / std::max(1.0, options_.epochs - 1.0));
    const double rate =
        options_.rate * damping_ * (0.01 + 0.99 * 0.5 * (1 + std::cos(EIGEN_PI * share)));
    const double unbias1 = 1 - std::pow(kBeta1, told_), unbias2 = 1 - std::pow(kBeta2, told_);
    for (Eigen::Index k = 0; k < u_.size(); ++k) {
      const double scale = std::sqrt(v_[k] / unbias2);
      if (scale > 0) u_[k] -= rate * (m_[k] / unbias1) / (scale + 1e-30);
    }
  }

  std::vector<double> pack() const override {
    Packer p;
    for (const double x : {epoch_, told_, damping_, mean_length_, best_loss_}) p.add(x);
    for (const Vector* v : {&u_, &best_, &m_, &v_}) p.add(*v);
    return p.state;
  }

  void unpack(const std::vector<double>& state) override {
    check_size(state, 5 + 4 * static_cast<std::size_t>(u_.size()));
    Unpacker p{state};
    for (double* x : {&epoch_, &told_, &damping_, &mean_length_, &best_loss_}) p.get(*x);
    for (Vector* v : {&u_, &best_, &m_, &v_}) p.get_matrix(*v);
  }

  void inherit(const std::vector<double>&) override {}  // its moments have the size of the old loss

 private:
  static constexpr double kBeta1 = 0.9, kBeta2 = 0.99;
  OptimizerOptions options_;
  double epoch_ = 0, told_ = 0, damping_ = 1, mean_length_ = 0, best_loss_ = kInfinity;
  Vector u_, best_, m_, v_;
};

class Bfgs : public Optimizer {
 public:
  Bfgs(const OptimizerOptions& options, const std::vector<double>& start)
      : options_(options),
        trial_(to_eigen(start)),
        x_(trial_),
        g_(Vector::Zero(x_.size())),
        direction_(g_),
        inverse_(Eigen::MatrixXd::Identity(x_.size(), x_.size())) {}

  std::vector<double> ask() const override { return to_std(trial_); }

  void tell(double loss, const std::vector<double>& gradient) override {
    if (!std::isfinite(loss)) {
      if (std::isfinite(f_)) shorten(0.25);
      return;  // without any point to go back to there is nothing to do but to fail again
    }
    const Vector g = to_eigen(gradient);
    if (!std::isfinite(f_)) {
      accept(loss, g);
      if (updates_ > 0) {
        begin_quasi_newton();
      } else {
        restart();
      }
      return;
    }
    const double slope = g_.dot(direction_);
    if (loss > f_ + 1e-4 * step_ * slope) {
      const double curvature = 2 * (loss - f_ - step_ * slope) / (step_ * step_);
      const double ratio = curvature > 0 ? -slope / curvature / step_ : 0.5;
      shorten(std::clamp(ratio, 0.1, 0.5));
      return;
    }
    const Vector s = trial_ - x_, y = g - g_;
    accept(loss, g);
    update_inverse(s, y);
    begin_quasi_newton();
  }

  std::vector<double> pack() const override {
    Packer p;
    for (const double x : {f_, step_, failures_, updates_, ever_updated_}) p.add(x);
    for (const Vector* v : {&trial_, &x_, &g_, &direction_}) p.add(*v);
    p.add(inverse_);
    return p.state;
  }

  void unpack(const std::vector<double>& state) override {
    check_size(state, packed_size());
    Unpacker p{state};
    for (double* x : {&f_, &step_, &failures_, &updates_, &ever_updated_}) p.get(*x);
    for (Vector* v : {&trial_, &x_, &g_, &direction_}) p.get_matrix(*v);
    p.get_matrix(inverse_);
  }

  void inherit(const std::vector<double>& state) override {
    if (state.size() != packed_size()) return;
    const Vector start = trial_;
    unpack(state);
    trial_ = x_ = start;
    f_ = kInfinity;
    updates_ = ever_updated_;  // even where the old search ended with a restart
  }

 private:
  std::size_t packed_size() const {
    const auto n = static_cast<std::size_t>(x_.size());
    return 5 + 4 * n + n * n;
  }

  void accept(double loss, const Vector& g) {
    f_ = loss;
    x_ = trial_;
    g_ = g;
  }

  /// Steepest descent with a first step of length `rate`.
  void restart() {
    updates_ = 0;
    const double length = g_.norm();
    direction_ = length > 0 ? Vector(-options_.rate / length * g_) : Vector::Zero(g_.size());
    begin_search();
  }

  void begin_quasi_newton() {
    direction_ = -(inverse_ * g_);
    if (g_.dot(direction_) < 0) {
      begin_search();
    } else {
      restart();
    }
  }

  void begin_search() {
    failures_ = 0;
    step_ = 1;
    const double length = direction_.norm();
    if (length > 10 * options_.rate) step_ = 10 * options_.rate / length;
    trial_ = x_ + step_ * direction_;
  }

  void shorten(double factor) {
    if (++failures_ >= 8) {
      restart_shorter();
      return;
    }
    step_ *= factor;
    trial_ = x_ + step_ * direction_;
  }

  /// The model of the Hessian is wrong here: along the gradient again, from where the line search
  /// ended.
  void restart_shorter() {
    const double length = std::min(options_.rate, step_ * direction_.norm());
    updates_ = 0;
    const double slope = g_.norm();
    direction_ = slope > 0 ? Vector(-length / slope * g_) : Vector::Zero(g_.size());
    begin_search();
  }

  void update_inverse(const Vector& s, const Vector& y) {
    const double sy = s.dot(y);
    if (!(sy > 1e-10 * s.norm() * y.norm())) return;  // keeps it positive definite
    if (updates_ == 0) inverse_.setIdentity(), inverse_ *= sy / y.squaredNorm();
    ++updates_;
    ever_updated_ = 1;
    const Vector hy = inverse_ * y;
    const double rho = 1 / sy;
    inverse_ += (rho * rho * (sy + y.dot(hy))) * (s * s.transpose()) -
                rho * (hy * s.transpose() + s * hy.transpose());
  }

  OptimizerOptions options_;
  double f_ = kInfinity, step_ = 1, failures_ = 0, updates_ = 0, ever_updated_ = 0;
  Vector trial_, x_, g_, direction_;
  Eigen::MatrixXd inverse_;
};

}  // namespace

std::unique_ptr<Optimizer> make_optimizer(const OptimizerOptions& options,
                                          const std::vector<double>& start) {
  if (options.method == "adam") return std::make_unique<Adam>(options, start);
  if (options.method == "bfgs") return std::make_unique<Bfgs>(options, start);
  throw Error("optimizer: expected adam or bfgs, found \"" + options.method + "\"");
}

}  // namespace uniphy
