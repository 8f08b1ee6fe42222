#include "ops/loss/law_losses.hpp"

#include <cmath>
#include <string>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/planes.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::ops {
namespace {

using kernels::kIsotropicLosses;
using kernels::kIsotropicMeans;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// What the kernels' inner loops read; all of it contiguous.
struct Arguments {
  Tensor columns, rows, scales, z, caps, caps_rest, moduli, moduli_rest;
  double floor = 0, delta = 0;

  std::int64_t trajectories() const { return rows.size(0); }
  std::int64_t samples() const { return rows.size(1); }
};

void check_batch(const char* op, Arguments& a) {
  const auto type = real_type(op, "columns", a.columns);
  a.columns = checked(op, "columns", a.columns, type, {kAnySize, kernels::SampleColumns::count});
  a.rows = checked(op, "rows", a.rows, torch::kInt64, {kAnySize, kAnySize});
  if (a.samples() == 0) throw Error(std::string(op) + ": rows: expected one sample or more");
  a.z = checked(op, "z", a.z, type, {a.trajectories(), kAnySize});
  if (a.z.size(1) < 2)
    throw Error(std::string(op) + ": z: expected 2 numbers or more a trajectory, found " +
                std::to_string(a.z.size(1)));
  const std::int64_t* row = a.rows.data_ptr<std::int64_t>();
  const std::int64_t table = a.columns.size(0);
  for (std::int64_t k = 0; k < a.rows.numel(); ++k)
    if (row[k] < 0 || row[k] >= table)
      throw Error(std::string(op) + ": rows: expected 0 ... " + std::to_string(table - 1) +
                  ", found " + std::to_string(row[k]));
}

/// One answer for each sample, or one for all; number by number in memory.
Tensor checked_answers(const char* name, const Tensor& t, const Arguments& a,
                       std::int64_t outputs) {
  const std::int64_t m = t.defined() && t.dim() == 3 && t.size(1) == 1 ? 1 : a.samples();
  check_tensor("law_losses", name, t, a.columns.scalar_type(), {a.trajectories(), m, outputs});
  return in_planes(t);
}

template <class T>
kernels::SampleFeatures<T> samples_of(const Arguments& a, std::int64_t i) {
  const double z1 = a.z.data_ptr<T>()[i * a.z.size(1) + 1];
  return {a.columns.data_ptr<T>(), a.rows.data_ptr<std::int64_t>() + i * a.samples(), a.samples(),
          T(kernels::kStrainScale * std::exp(kernels::kStrainRate * z1))};
}

/// Where the answers at rest that are taken off stand.
constexpr std::int64_t cap_at(std::int64_t i) {
  return kernels::kCapOutputs * i + kernels::kTraceCap;
}
constexpr std::int64_t pressure_at(std::int64_t i) {
  return kernels::kStressOutputs * i + kernels::kPressure;
}

template <class T>
kernels::IsotropicAnswers<T> answers_of(const Arguments& a, std::int64_t i) {
  const auto square = [](double x) { return T(x * x); };
  const double z0 = a.z.data_ptr<T>()[i * a.z.size(1)];
  const T* rms = a.scales.data_ptr<T>() + 4 * i;
  return {samples_of<T>(a, i),
          a.caps.data_ptr<T>() + i * a.caps.stride(0),
          a.moduli.data_ptr<T>() + i * a.moduli.stride(0),
          a.caps.size(1) > 1,
          a.moduli.size(1) > 1,
          std::min(a.caps_rest.data_ptr<T>()[cap_at(i)], T(0)),
          a.moduli_rest.data_ptr<T>()[pressure_at(i)],
          T(kernels::kStressScale * std::exp(kernels::kStressRate * z0)),
          rms[3],
          square(a.floor * rms[0]),
          square(a.floor * (rms[2] > 0 ? rms[2] : rms[1])),
          T(a.delta)};
}

template <class T>
void evaluate(const Arguments& a, const Tensor& losses, const Tensor& errors) {
  const auto& table = kernels::law_losses_table<T>();
  const std::int64_t n = a.trajectories();
  T *to_losses = losses.data_ptr<T>(), *to_errors = errors.data_ptr<T>();
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < n; ++i) {
    T means[kIsotropicMeans];
    table.errors(answers_of<T>(a, i), means);
    for (int k = 0; k < kIsotropicLosses; ++k) to_losses[i * kIsotropicLosses + k] = means[k];
    to_errors[2 * i] = means[kernels::kStressError];
    to_errors[2 * i + 1] = means[kernels::kProjectionError];
  }
}

/// Gradients in the order of Arguments; undefined where they are not wanted.
struct Gradients {
  Tensor z, caps, caps_rest, moduli, moduli_rest;
};
template <class T>
void adjoint(const Arguments& a, const Tensor& grad_losses, const Gradients& to) {
  const auto& table = kernels::law_losses_table<T>();
  const std::int64_t n = a.trajectories(), latent = a.z.size(1);
  const T* weights = grad_losses.data_ptr<T>();
  const auto data = [](const Tensor& t) { return t.defined() ? t.data_ptr<T>() : nullptr; };
  T *z = data(to.z), *caps = data(to.caps), *caps_rest = data(to.caps_rest),
    *moduli = data(to.moduli), *moduli_rest = data(to.moduli_rest);
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < n; ++i) {
    kernels::IsotropicAnswersGradient<T> g{};
    if (caps) g.caps = caps + i * a.caps.stride(0);
    if (moduli) g.moduli = moduli + i * a.moduli.stride(0);
    table.errors_adjoint(answers_of<T>(a, i), weights + i * kIsotropicLosses, g);
    const bool caps_at_rest = a.caps_rest.data_ptr<T>()[cap_at(i)] <= 0;
    if (caps_rest) caps_rest[cap_at(i)] = caps_at_rest ? g.rest_cap : T(0);
    if (moduli_rest) moduli_rest[pressure_at(i)] = g.rest_pressure;
    if (z) {
      z[i * latent] = T(kernels::kStressRate) * g.log_s;
      z[i * latent + 1] = T(kernels::kStrainRate) * g.log_e;
    }
  }
}

class LawLossesFunction : public torch::autograd::Function<LawLossesFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& z, const Tensor& caps,
                               const Tensor& caps_rest, const Tensor& moduli,
                               const Tensor& moduli_rest, const Tensor& columns, const Tensor& rows,
                               const Tensor& scales, double floor, double delta) {
    const Arguments a{columns, rows, scales, z, caps, caps_rest, moduli, moduli_rest, floor, delta};
    const Tensor losses = torch::empty({a.trajectories(), kIsotropicLosses}, z.options());
    const Tensor errors = torch::empty({a.trajectories(), 2}, z.options());
    for_real_type(z.scalar_type(), [&](auto zero) { evaluate<decltype(zero)>(a, losses, errors); });
    ctx->save_for_backward({z, caps, caps_rest, moduli, moduli_rest, columns, rows, scales});
    ctx->saved_data["floor"] = floor;
    ctx->saved_data["delta"] = delta;
    ctx->mark_non_differentiable({errors});
    ctx->set_materialize_grads(false);
    return {losses, errors};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    variable_list result(10);
    if (!grad[0].defined()) return result;
    const variable_list s = ctx->get_saved_variables();
    const Arguments a{s[5],
                      s[6],
                      s[7],
                      s[0],
                      s[1],
                      s[2],
                      s[3],
                      s[4],
                      ctx->saved_data["floor"].toDouble(),
                      ctx->saved_data["delta"].toDouble()};
    // z and the answers at rest: what is not written is 0.
    const auto zeros = [&](std::size_t k) {
      return ctx->needs_input_grad(k) ? torch::zeros_like(s[k]) : Tensor();
    };
    const auto empty = [&](std::size_t k) {
      return ctx->needs_input_grad(k) ? empty_planes(s[k].sizes(), s[k].options()) : Tensor();
    };
    const Gradients to{zeros(0), empty(1), zeros(2), empty(3), zeros(4)};
    const Tensor grad_losses = grad[0].contiguous();
    for_real_type(a.z.scalar_type(),
                  [&](auto zero) { adjoint<decltype(zero)>(a, grad_losses, to); });
    result[0] = to.z;
    result[1] = to.caps;
    result[2] = to.caps_rest;
    result[3] = to.moduli;
    result[4] = to.moduli_rest;
    return once_differentiable("law_losses", std::move(result));
  }
};

class IsotropicFeaturesFunction : public torch::autograd::Function<IsotropicFeaturesFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& z, const Tensor& columns,
                               const Tensor& rows) {
    Arguments a;
    a.columns = columns, a.rows = rows, a.z = z;
    const std::int64_t n = a.trajectories(), m = a.samples();
    const Tensor projection = empty_planes({n, m, 3}, z.options());
    const Tensor stress = empty_planes({n, m, 6}, z.options());
    for_real_type(z.scalar_type(), [&](auto zero) {
      using T = decltype(zero);
      const auto& table = kernels::law_losses_table<T>();
      T *to_projection = projection.data_ptr<T>(), *to_stress = stress.data_ptr<T>();
#pragma omp parallel for schedule(static)
      for (std::int64_t i = 0; i < n; ++i)
        table.features(samples_of<T>(a, i), to_projection + 3 * m * i, to_stress + 6 * m * i);
    });
    ctx->save_for_backward({z, columns, rows});
    ctx->set_materialize_grads(false);
    return {projection, stress};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    variable_list result(3);
    if (!grad[0].defined() && !grad[1].defined()) return result;
    const variable_list s = ctx->get_saved_variables();
    Arguments a;
    a.z = s[0], a.columns = s[1], a.rows = s[2];
    const std::int64_t n = a.trajectories(), m = a.samples(), latent = a.z.size(1);
    result[0] = torch::zeros_like(a.z);
    for_real_type(a.z.scalar_type(), [&](auto zero) {
      using T = decltype(zero);
      const auto& table = kernels::law_losses_table<T>();
      for (Tensor& g : grad)
        if (g.defined()) g = in_planes(g);
      const T* of_projection = grad[0].defined() ? grad[0].data_ptr<T>() : nullptr;
      const T* of_stress = grad[1].defined() ? grad[1].data_ptr<T>() : nullptr;
      T* to = result[0].template data_ptr<T>();
#pragma omp parallel for schedule(static)
      for (std::int64_t i = 0; i < n; ++i)
        to[i * latent + 1] =
            T(kernels::kStrainRate) *
            table.features_adjoint(samples_of<T>(a, i),
                                   of_projection ? of_projection + 3 * m * i : nullptr,
                                   of_stress ? of_stress + 6 * m * i : nullptr);
    });
    return once_differentiable("isotropic_features", std::move(result));
  }
};

}  // namespace

IsotropicFeatures isotropic_features(const IsotropicBatch& batch, const Tensor& z) {
  Arguments a;
  a.columns = batch.columns, a.rows = batch.rows, a.z = z;
  check_batch("isotropic_features", a);
  const variable_list r = IsotropicFeaturesFunction::apply(a.z, a.columns, a.rows);
  return {r[0], r[1]};
}

LawLosses law_losses(const IsotropicBatch& batch, const Tensor& scales, const Tensor& z,
                     const IsotropicAnswers& answers, const ErrorMeasure& measure) {
  constexpr const char* kOp = "law_losses";
  Arguments a;
  a.columns = batch.columns, a.rows = batch.rows, a.z = z;
  check_batch(kOp, a);
  const auto type = a.columns.scalar_type();
  a.scales = checked(kOp, "scales", scales, type, {a.trajectories(), 4});
  a.caps = checked_answers("caps", answers.caps, a, kernels::kCapOutputs);
  a.caps_rest = checked(kOp, "caps_rest", answers.caps_rest, type,
                        {a.trajectories(), 1, kernels::kCapOutputs});
  a.moduli = checked_answers("moduli", answers.moduli, a, kernels::kStressOutputs);
  a.moduli_rest = checked(kOp, "moduli_rest", answers.moduli_rest, type,
                          {a.trajectories(), 1, kernels::kStressOutputs});
  const variable_list r =
      LawLossesFunction::apply(a.z, a.caps, a.caps_rest, a.moduli, a.moduli_rest, a.columns, a.rows,
                               a.scales, measure.floor, measure.delta);
  return {r[0], r[1]};
}

}  // namespace uniphy::ops
