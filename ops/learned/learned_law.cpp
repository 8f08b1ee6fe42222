#include "ops/learned/learned_law.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/learned/learned_law.hpp"
#include "ops/kernels/simd/aligned_buffer.hpp"
#include "ops/laws/material.hpp"

namespace uniphy::ops {

using kernels::LawKernel;
using kernels::View;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

/// Particles a thread takes at once: fixed, so that sums over particles have one order.
constexpr std::ptrdiff_t kBlock = 4 * kernels::kLawChunk;

/// Running sums of the weights, to which blocks are dealt in order.
constexpr std::ptrdiff_t kWeightSums = 16;

constexpr const char* kOp = "learned law";

void check_arguments(const LearnedNetworks& networks, const char* F_name, const Tensor& F,
                     const Tensor& C, const Tensor& z) {
  check_networks(kOp, networks);
  check_matrices(kOp, F_name, F);
  if (C.defined()) check_like(kOp, "C", C, F);
  check_tensor(kOp, "z", z, F.scalar_type(), {networks.latent_size});
}

/// The kernels of one forward call, kept for its backward.
struct Kernel : torch::CustomClassHolder {
  std::shared_ptr<const LawKernel<float>> narrow;
  std::shared_ptr<const LawKernel<double>> wide;
  double dt;

  Kernel(const LearnedNetworks& networks, LawPart part, const Tensor& z, double step) : dt(step) {
    kernels::LawDescription d;
    d.id = kernels::LawId::learned;
    d.weights = kernel_weights(networks, part);
    const Tensor numbers = z.to(torch::kFloat64).contiguous();
    d.z.assign(numbers.data_ptr<double>(), numbers.data_ptr<double>() + numbers.numel());
    if (z.scalar_type() == torch::kFloat64)
      wide = kernels::make_learned_law<double>(d);
    else
      narrow = kernels::make_learned_law<float>(d);
  }
};

template <class T>
void evaluate(const LawKernel<T>& law, double dt, const Tensor& F, const Tensor& C,
              const Tensor& F_proj, const Tensor& tau) {
  const std::ptrdiff_t count = F.size(0);
  const View<const T> f = matrix_view<T>(F), c = matrix_view<T>(C);
  const View<T> fp = mutable_matrix_view<T>(F_proj), t = mutable_matrix_view<T>(tau);
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t p = 0; p < count; p += kBlock)
    law.evaluate(std::min(kBlock, count - p), T(dt), f.from(p), c.from(p), fp.from(p), t.from(p));
}

/// Gradients of F, C, z and all weights, flat, each where it is defined.
template <class T>
void adjoint(const LawKernel<T>& law, double dt, const Tensor& F, const Tensor& C,
             const Tensor& grad_F_proj, const Tensor& grad_tau, const Tensor& grad_F,
             const Tensor& grad_C, const Tensor& grad_z, const Tensor& grad_weights) {
  const std::ptrdiff_t count = F.size(0), blocks = (count + kBlock - 1) / kBlock;
  const std::ptrdiff_t size = law.accumulator_size(), weight_size = law.weight_sums_size();
  const View<const T> f = matrix_view<T>(F), c = matrix_view<T>(C),
                      gp = matrix_view<T>(grad_F_proj), gt = matrix_view<T>(grad_tau);
  const View<T> gf = mutable_matrix_view<T>(grad_F), gc = mutable_matrix_view<T>(grad_C);
  const bool weights = grad_weights.defined(), any = weights || grad_z.defined();
  std::vector<T> sums(any ? std::size_t(blocks * size) : 0, T(0));
  // A thread takes what belongs to one running sum of the weights; without them, one block.
  const std::ptrdiff_t parts = weights ? std::min(kWeightSums, blocks) : blocks;
  kernels::AlignedBuffer<T> weight_sums(weights ? std::max<std::ptrdiff_t>(parts, 1) * weight_size
                                                : 0);
  weight_sums.fill(T(0));
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t part = 0; part < parts; ++part) {
    T* const of_part = weights ? weight_sums.data() + part * weight_size : nullptr;
    for (std::ptrdiff_t b = part * blocks / parts; b < (part + 1) * blocks / parts; ++b) {
      const std::ptrdiff_t p = b * kBlock;
      law.adjoint(std::min(kBlock, count - p), T(dt), f.from(p), c.from(p), gp.from(p), gt.from(p),
                  gf.from(p), gc.from(p), any ? sums.data() + b * size : nullptr, of_part);
    }
  }
  if (!any) return;
  std::vector<T> total(std::size_t(size), T(0));
  for (std::ptrdiff_t b = 0; b < blocks; ++b)
    for (std::ptrdiff_t k = 0; k < size; ++k) total[k] += sums[b * size + k];
  if (grad_z.defined()) law.parameter_gradient(total.data(), grad_z.data_ptr<T>());
  if (!weights) return;
  for (std::ptrdiff_t part = 1; part < parts; ++part)
    for (std::ptrdiff_t k = 0; k < weight_size; ++k)
      weight_sums[k] += weight_sums[part * weight_size + k];
  law.weight_gradient(total.data(), weight_sums.data(), grad_weights.data_ptr<T>());
}

class LearnedLawFunction : public torch::autograd::Function<LearnedLawFunction> {
 public:
  /// The numbers of the networks are there for the graph; the kernels take them from `networks`.
  static variable_list forward(AutogradContext* ctx, const Tensor& F, const Tensor& C,
                               const Tensor& z, const Tensor& projection, const Tensor& stress,
                               const LearnedNetworks& networks, LawPart part, double dt) {
    const Tensor f = F.contiguous(), c = C.contiguous();
    const auto kernel = c10::make_intrusive<Kernel>(networks, part, z, dt);
    Tensor F_proj = torch::empty_like(f), tau = torch::empty_like(f);
    if (kernel->wide)
      evaluate(*kernel->wide, dt, f, c, F_proj, tau);
    else
      evaluate(*kernel->narrow, dt, f, c, F_proj, tau);
    ctx->save_for_backward({f, c, z});
    ctx->saved_data["kernel"] = torch::IValue::make_capsule(kernel);
    ctx->saved_data["projection"] = projection.numel();
    ctx->saved_data["stress"] = stress.numel();
    ctx->saved_data["double"] = projection.scalar_type() == torch::kFloat64;
    ctx->set_materialize_grads(false);
    return {F_proj, tau};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    variable_list result(8);
    if (!grad[0].defined() && !grad[1].defined()) return result;
    const auto saved = ctx->get_saved_variables();
    const Tensor F = saved[0], C = saved[1], z = saved[2];
    const auto kernel =
        c10::static_intrusive_pointer_cast<Kernel>(ctx->saved_data["kernel"].toCapsule());
    const auto given = [&F](const Tensor& g) {
      return g.defined() ? g.contiguous() : torch::zeros_like(F);
    };
    const Tensor grad_F_proj = given(grad[0]), grad_tau = given(grad[1]);
    // The adjoint adds to the gradient of C.
    Tensor grad_weights;
    if (ctx->needs_input_grad(0)) result[0] = torch::empty_like(F);
    if (ctx->needs_input_grad(1)) result[1] = torch::zeros_like(C);
    if (ctx->needs_input_grad(2)) result[2] = torch::zeros_like(z, torch::MemoryFormat::Contiguous);
    const bool of_projection = ctx->needs_input_grad(3), of_stress = ctx->needs_input_grad(4);
    const auto run = [&](const auto& law) {
      if (of_projection || of_stress)
        grad_weights = torch::empty({std::int64_t(law.weight_size())}, F.options());
      adjoint(law, kernel->dt, F, C, grad_F_proj, grad_tau, result[0], result[1], result[2],
              grad_weights);
    };
    if (kernel->wide)
      run(*kernel->wide);
    else
      run(*kernel->narrow);
    // The projection's come first; a network that does not run has some of its own in the law.
    const auto type = ctx->saved_data["double"].toBool() ? torch::kFloat64 : torch::kFloat32;
    const std::int64_t first = ctx->saved_data["projection"].toInt(),
                       last = ctx->saved_data["stress"].toInt();
    if (of_projection) result[3] = grad_weights.narrow(0, 0, first).to(type);
    if (of_stress) result[4] = grad_weights.narrow(0, grad_weights.size(0) - last, last).to(type);
    return once_differentiable(kOp, std::move(result));
  }
};

LawOutput apply(const LearnedNetworks& networks, LawPart part, const Tensor& F, const Tensor& C,
                const Tensor& z, double dt) {
  if (!(dt > 0) || !std::isfinite(dt))
    throw Error(std::string(kOp) + ": dt: expected a time step above 0 s, found " +
                std::to_string(dt));
  // A network that does not run has no gradient.
  const Tensor none = torch::empty({0}, networks.projection.numbers.options().requires_grad(false));
  const auto r = LearnedLawFunction::apply(
      F, C, z, part == LawPart::stress ? none : networks.projection.numbers,
      part == LawPart::projection ? none : networks.stress.numbers, networks, part, dt);
  return {r[0], r[1]};
}

}  // namespace

LawOutput learned_law(const LearnedNetworks& networks, const Tensor& F_trial, const Tensor& C,
                      const Tensor& z, double dt) {
  check_arguments(networks, "F_trial", F_trial, C, z);
  if (!C.defined()) check_like(kOp, "C", C, F_trial);
  return apply(networks, LawPart::both, F_trial, C, z, dt);
}

Tensor learned_project(const LearnedNetworks& networks, const Tensor& F, const Tensor& z,
                       double dt) {
  check_arguments(networks, "F", F, Tensor(), z);
  return apply(networks, LawPart::projection, F, torch::zeros_like(F), z, dt).F_proj;
}

Tensor learned_stress(const LearnedNetworks& networks, const Tensor& F_proj, const Tensor& C,
                      const Tensor& z) {
  check_arguments(networks, "F_proj", F_proj, C, z);
  if (!C.defined()) check_like(kOp, "C", C, F_proj);
  return apply(networks, LawPart::stress, F_proj, C, z, kernels::kFlowStep).tau;
}

}  // namespace uniphy::ops
