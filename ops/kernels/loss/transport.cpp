#include "ops/kernels/loss/transport.hpp"

#include <algorithm>

namespace uniphy::kernels {
namespace {

/// Part of the softmin that an iteration takes; the rest is the potential from before.
double share_of(std::size_t iteration) { return iteration == 0 ? 1 : 0.5; }

/// f, g, p one behind the other.
struct Potentials {
  std::ptrdiff_t particles, cloud;  ///< padded

  std::ptrdiff_t size() const { return 2 * particles + cloud; }
  template <class T>
  T* f(T* at) const {
    return at;
  }
  template <class T>
  T* g(T* at) const {
    return at + particles;
  }
  template <class T>
  T* p(T* at) const {
    return at + particles + cloud;
  }
};

/// A pass over the iterations of one problem, and where its history holds what.
class Transport {
 public:
  explicit Transport(const TransportProblem& problem)
      : x_(problem.particles),
        y_(problem.cloud),
        epsilon_(*problem.schedule),
        at_{x_.padded, y_.padded},
        scratch_(5 * std::max(x_.padded, y_.padded)) {}

  void forward(double* history, double* displacement) {
    const std::ptrdiff_t size = at_.size();
    std::fill_n(history, size, 0.0);
    std::vector<double> next(size);
    for (std::size_t t = 0; t < epsilon_.size(); ++t) {
      const double* now = history + t * size;
      std::fill(next.begin(), next.end(), 0.0);
      softmin(x_, y_, at_.g(now), epsilon_[t], at_.f(next.data()));
      softmin(y_, x_, at_.f(now), epsilon_[t], at_.g(next.data()));
      softmin(x_, x_, at_.p(now), epsilon_[t], at_.p(next.data()));
      const double share = share_of(t);
      double* to = history + (t + 1) * size;
      for (std::ptrdiff_t k = 0; k < size; ++k) to[k] = (1 - share) * now[k] + share * next[k];
    }
    const double* last = potentials(history, epsilon_.size());
    double* to = history + (epsilon_.size() + 1) * size;
    const auto barycentres = [&](const WeightedPoints& columns, const double* g, double* map) {
      table_.barycentres(x_, columns, g, epsilon_.back(), scratch_.data(), map, map + x_.padded);
    };
    double *of_cloud = to, *of_itself = to + 4 * x_.padded;
    std::fill_n(to, 8 * x_.padded, 0.0);
    barycentres(y_, at_.g(last), of_cloud);
    barycentres(x_, at_.p(last), of_itself);
    for (std::ptrdiff_t k = 0; k < 3 * x_.padded; ++k)
      displacement[k] = of_itself[x_.padded + k] - of_cloud[x_.padded + k];
  }

  void adjoint(const double* history, const double* grad_displacement, double* grad_x) {
    const std::ptrdiff_t size = at_.size();
    std::vector<double> gradient(size), minus(3 * x_.padded);
    for (std::size_t k = 0; k < minus.size(); ++k) minus[k] = -grad_displacement[k];
    const double* last = potentials(history, epsilon_.size());
    const double* of_cloud = potentials(history, epsilon_.size() + 1);
    const double* of_itself = of_cloud + 4 * x_.padded;
    table_.barycentres_adjoint(x_, y_, at_.g(last), epsilon_.back(), scratch_.data(), of_cloud,
                               of_cloud + x_.padded, minus.data(), grad_x, nullptr,
                               at_.g(gradient.data()));
    table_.barycentres_adjoint(x_, x_, at_.p(last), epsilon_.back(), scratch_.data(), of_itself,
                               of_itself + x_.padded, grad_displacement, grad_x, grad_x,
                               at_.p(gradient.data()));
    for (std::size_t t = epsilon_.size(); t-- > 0;) step_back(history, t, gradient, grad_x);
  }

 private:
  const double* potentials(const double* history, std::size_t iteration) const {
    return history + iteration * at_.size();
  }

  void softmin(const WeightedPoints& rows, const WeightedPoints& columns, const double* potentials,
               double epsilon, double* result) {
    table_.softmin(rows, columns, potentials, epsilon, scratch_.data(), result);
  }

  /// From the gradient by the potentials after iteration t to that by those before it.
  void step_back(const double* history, std::size_t t, std::vector<double>& gradient,
                 double* grad_x) {
    const double *before = potentials(history, t), *after = potentials(history, t + 1);
    const double share = share_of(t);
    std::vector<double> softmin(gradient.size()), of_softmin(gradient.size());
    for (std::size_t k = 0; k < gradient.size(); ++k) {
      softmin[k] = (after[k] - (1 - share) * before[k]) / share;
      of_softmin[k] = share * gradient[k];
      gradient[k] *= 1 - share;
    }
    const auto through = [&](const WeightedPoints& rows, const WeightedPoints& columns,
                             auto potential, auto result, double* grad_rows, double* grad_columns) {
      table_.softmin_adjoint(rows, columns, potential(before), epsilon_[t], scratch_.data(),
                             result(softmin.data()), result(of_softmin.data()), grad_rows,
                             grad_columns, potential(gradient.data()));
    };
    const auto f = [&](auto* at) { return at_.f(at); };
    const auto g = [&](auto* at) { return at_.g(at); };
    const auto p = [&](auto* at) { return at_.p(at); };
    through(x_, y_, g, f, grad_x, nullptr);
    through(y_, x_, f, g, nullptr, grad_x);
    through(x_, x_, p, p, grad_x, grad_x);
  }

  const SoftminTable& table_ = table_of<SoftminTable>();
  WeightedPoints x_, y_;
  const std::vector<double>& epsilon_;
  Potentials at_;
  std::vector<double> scratch_;
};

}  // namespace

std::vector<double> transport_schedule(double extent, double blur, int iterations) {
  std::vector<double> epsilon;
  for (double length = extent; length > blur; length /= 2) epsilon.push_back(length * length);
  epsilon.insert(epsilon.end(), iterations, blur * blur);
  return epsilon;
}

std::ptrdiff_t transport_history_size(std::size_t iterations, std::ptrdiff_t padded_particles,
                                      std::ptrdiff_t padded_cloud) {
  const Potentials at{padded_particles, padded_cloud};
  return static_cast<std::ptrdiff_t>(iterations + 1) * at.size() + 8 * padded_particles;
}

void transport_displacement(const TransportProblem& problem, double* history,
                            double* displacement) {
  Transport(problem).forward(history, displacement);
}

void transport_displacement_adjoint(const TransportProblem& problem, const double* history,
                                    const double* grad_displacement, double* grad_x) {
  Transport(problem).adjoint(history, grad_displacement, grad_x);
}

}  // namespace uniphy::kernels
