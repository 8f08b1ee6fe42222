#include "ops/kernels/laws/analytic_law.hpp"

#include <cmath>
#include <sstream>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/law_parameters.hpp"

namespace uniphy::kernels {
namespace {

void check_parameter(const LawDescription& d, const LawParameter& p) {
  const double value = d.*p.member;
  const bool in_range = (p.positive ? value > 0 : value >= 0) && value < p.below;
  if (std::isfinite(value) && in_range) return;
  std::ostringstream message;
  message << "law " << law_name(d.id) << ": parameter " << p.name << ": expected a finite "
          << (std::isfinite(p.below) ? "angle in [0, pi/2)"
              : p.positive           ? "number > 0"
                                     : "number >= 0")
          << ", found " << value;
  throw Error(message.str());
}

template <class T>
class AnalyticLaw final : public LawKernel<T> {
 public:
  AnalyticLaw(const LawDescription& d, Isa isa)
      : has_memory_(law_has_memory(d.id)),
        taken_(law_parameters(d.id)),
        law_(law_table<T>(isa).laws[static_cast<int>(d.id)]),
        parameters_(kernel_parameters<T>(d)) {}

  bool has_memory() const override { return has_memory_; }
  std::ptrdiff_t parameter_size() const override {
    return static_cast<std::ptrdiff_t>(taken_.size());
  }
  std::ptrdiff_t accumulator_size() const override { return kLawParameters; }
  void parameter_gradient(const T* accumulator, T* gradient) const override {
    for (const LawParameter& p : taken_) *gradient++ = accumulator[p.place];
  }

  void evaluate(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C, View<T> F_proj,
                View<T> tau, const LawMemory<T>& memory) const override {
    law_.evaluate(count, parameters_, dt, F_trial, C, F_proj, tau, memory);
  }
  void adjoint(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C,
               View<const T> grad_F_proj, View<const T> grad_tau, View<T> grad_F_trial,
               View<T> grad_C, T* accumulator, T*,
               const LawMemoryAdjoint<T>& memory) const override {
    LawParameters<T> sum;
    law_.adjoint(count, parameters_, dt, F_trial, C, grad_F_proj, grad_tau, grad_F_trial, grad_C,
                 accumulator ? &sum : nullptr, memory);
    if (accumulator == nullptr) return;
    for (int i = 0; i < kLawParameters; ++i) accumulator[i] += sum.*kLawParameterMembers<T>[i];
  }

 private:
  bool has_memory_;
  const std::vector<LawParameter>& taken_;
  typename LawTable<T>::Law law_;
  LawParameters<T> parameters_;
};

}  // namespace

void check_parameters(const LawDescription& description) {
  if (description.id == LawId::learned)
    throw Error("law learned: has a latent code, not parameters");
  for (const LawParameter& p : law_parameters(description.id)) check_parameter(description, p);
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
