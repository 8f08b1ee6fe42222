#include "ops/kernels/laws/analytic_law.hpp"

#include <cmath>
#include <sstream>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {
namespace {

constexpr const char* kNames[kLawParameters] = {"mu", "lambda", "tau_y", "theta", "eta"};

double value_of(const LawDescription& d, int place) {
  const double values[kLawParameters] = {d.mu, d.lambda, d.tau_y, d.theta, d.eta};
  return values[place];
}

void check_parameter(const LawDescription& d, int place) {
  const double value = value_of(d, place);
  const bool may_vanish = place >= 2;
  const bool is_angle = place == 3;
  const bool in_range = may_vanish ? value >= 0 : value > 0;
  if (std::isfinite(value) && in_range && !(is_angle && value >= 1.5707963267948966)) return;
  std::ostringstream message;
  message << "law " << law_name(d.id) << ": parameter " << kNames[place] << ": expected a finite "
          << (is_angle     ? "angle in [0, pi/2)"
              : may_vanish ? "number >= 0"
                           : "number > 0")
          << ", found " << value;
  throw Error(message.str());
}

template <class T>
class AnalyticLaw final : public LawKernel<T> {
 public:
  AnalyticLaw(const LawDescription& d, Isa isa)
      : places_(parameter_places(d.id)),
        law_(law_table<T>(isa).laws[static_cast<int>(d.id)]),
        parameters_{T(d.mu), T(d.lambda), T(d.tau_y), T(d.theta), T(d.eta)} {}

  std::ptrdiff_t parameter_size() const override {
    return static_cast<std::ptrdiff_t>(places_.size());
  }
  std::ptrdiff_t accumulator_size() const override { return kLawParameters; }
  void parameter_gradient(const T* accumulator, T* gradient) const override {
    for (std::size_t i = 0; i < places_.size(); ++i) gradient[i] = accumulator[places_[i]];
  }

  void evaluate(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C, View<T> F_proj,
                View<T> tau) const override {
    law_.evaluate(count, parameters_, dt, F_trial, C, F_proj, tau);
  }
  void adjoint(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C,
               View<const T> grad_F_proj, View<const T> grad_tau, View<T> grad_F_trial,
               View<T> grad_C, T* accumulator) const override {
    LawParameters<T> sum;
    law_.adjoint(count, parameters_, dt, F_trial, C, grad_F_proj, grad_tau, grad_F_trial, grad_C,
                 accumulator ? &sum : nullptr);
    if (accumulator == nullptr) return;
    const T values[kLawParameters] = {sum.mu, sum.lambda, sum.tau_y, sum.theta, sum.eta};
    for (int i = 0; i < kLawParameters; ++i) accumulator[i] += values[i];
  }

 private:
  std::vector<int> places_;
  typename LawTable<T>::Law law_;
  LawParameters<T> parameters_;
};

}  // namespace

std::vector<int> parameter_places(LawId id) {
  if (id == LawId::learned) throw Error("law learned: has a latent code, not parameters");
  std::vector<int> places;
  for (const std::string& name : parameter_names(id)) {
    for (int i = 0; i < kLawParameters; ++i) {
      if (name == kNames[i]) places.push_back(i);
    }
  }
  return places;
}

void check_parameters(const LawDescription& description) {
  for (const int place : parameter_places(description.id)) check_parameter(description, place);
}

template <class T>
std::shared_ptr<const LawKernel<T>> make_analytic_law(const LawDescription& description, Isa isa) {
  check_parameters(description);
  return std::make_shared<AnalyticLaw<T>>(description, isa);
}

template std::shared_ptr<const LawKernel<float>> make_analytic_law<float>(const LawDescription&,
                                                                          Isa);
template std::shared_ptr<const LawKernel<double>> make_analytic_law<double>(const LawDescription&,
                                                                            Isa);

}  // namespace uniphy::kernels
