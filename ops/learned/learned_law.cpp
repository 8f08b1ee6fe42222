#include "ops/learned/learned_law.hpp"

#include <torch/torch.h>

#include <algorithm>
#include <vector>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/learned/learned_law.hpp"
#include "ops/laws/material.hpp"

namespace uniphy::ops {

using kernels::LawKernel;
using kernels::LearnedLawWeights;
using kernels::View;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

/// Particles a thread takes at once: fixed, so that sums over particles have one order.
constexpr std::ptrdiff_t kBlock = 4 * kernels::kLawChunk;

constexpr const char* kOp = "learned law";

void check_arguments(const SharedWeights& weights, const char* F_name, const Tensor& F,
                     const Tensor& C, const Tensor& z) {
  if (!weights) throw Error("learned law: expected a trained model, found none");
  check_matrices(kOp, F_name, F);
  if (C.defined()) check_like(kOp, "C", C, F);
  check_tensor(kOp, "z", z, F.scalar_type(), {weights->latent_size});
}

/// The kernels of one forward call, kept for its backward.
struct Kernel : torch::CustomClassHolder {
  std::shared_ptr<const LawKernel<float>> narrow;
  std::shared_ptr<const LawKernel<double>> wide;

  Kernel(const SharedWeights& weights, const Tensor& z) {
    kernels::LawDescription d;
    d.id = kernels::LawId::learned;
    d.weights = weights;
    const Tensor numbers = z.to(torch::kFloat64).contiguous();
    d.z.assign(numbers.data_ptr<double>(), numbers.data_ptr<double>() + numbers.numel());
    if (z.scalar_type() == torch::kFloat64)
      wide = kernels::make_learned_law<double>(d);
    else
      narrow = kernels::make_learned_law<float>(d);
  }
};

template <class T>
void evaluate(const LawKernel<T>& law, const Tensor& F, const Tensor& C, const Tensor& F_proj,
              const Tensor& tau) {
  const std::ptrdiff_t count = F.size(0);
  const View<const T> f = matrix_view<T>(F), c = matrix_view<T>(C);
  const View<T> fp = mutable_matrix_view<T>(F_proj), t = mutable_matrix_view<T>(tau);
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t p = 0; p < count; p += kBlock)
    law.evaluate(std::min(kBlock, count - p), T(0), f.from(p), c.from(p), fp.from(p), t.from(p));
}

template <class T>
void adjoint(const LawKernel<T>& law, const Tensor& F, const Tensor& C, const Tensor& grad_F_proj,
             const Tensor& grad_tau, const Tensor& grad_F, const Tensor& grad_C,
             const Tensor& grad_z) {
  const std::ptrdiff_t count = F.size(0), blocks = (count + kBlock - 1) / kBlock;
  const std::ptrdiff_t size = law.accumulator_size();
  const View<const T> f = matrix_view<T>(F), c = matrix_view<T>(C),
                      gp = matrix_view<T>(grad_F_proj), gt = matrix_view<T>(grad_tau);
  const View<T> gf = mutable_matrix_view<T>(grad_F), gc = mutable_matrix_view<T>(grad_C);
  std::vector<T> sums(grad_z.defined() ? std::size_t(blocks * size) : 0, T(0));
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t b = 0; b < blocks; ++b) {
    const std::ptrdiff_t p = b * kBlock;
    law.adjoint(std::min(kBlock, count - p), T(0), f.from(p), c.from(p), gp.from(p), gt.from(p),
                gf.from(p), gc.from(p), sums.empty() ? nullptr : sums.data() + b * size);
  }
  if (!grad_z.defined()) return;
  std::vector<T> total(std::size_t(size), T(0));
  for (std::ptrdiff_t b = 0; b < blocks; ++b)
    for (std::ptrdiff_t k = 0; k < size; ++k) total[k] += sums[b * size + k];
  law.parameter_gradient(total.data(), grad_z.data_ptr<T>());
}

class LearnedLawFunction : public torch::autograd::Function<LearnedLawFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& F, const Tensor& C,
                               const Tensor& z, const SharedWeights& weights) {
    const Tensor f = F.contiguous(), c = C.contiguous();
    const auto kernel = c10::make_intrusive<Kernel>(weights, z);
    Tensor F_proj = torch::empty_like(f), tau = torch::empty_like(f);
    if (kernel->wide)
      evaluate(*kernel->wide, f, c, F_proj, tau);
    else
      evaluate(*kernel->narrow, f, c, F_proj, tau);
    ctx->save_for_backward({f, c, z});
    ctx->saved_data["kernel"] = torch::IValue::make_capsule(kernel);
    ctx->set_materialize_grads(false);
    return {F_proj, tau};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    if (!grad[0].defined() && !grad[1].defined()) return {Tensor(), Tensor(), Tensor(), Tensor()};
    const auto saved = ctx->get_saved_variables();
    const Tensor F = saved[0], C = saved[1], z = saved[2];
    const auto kernel =
        c10::static_intrusive_pointer_cast<Kernel>(ctx->saved_data["kernel"].toCapsule());
    const auto given = [&F](const Tensor& g) {
      return g.defined() ? g.contiguous() : torch::zeros_like(F);
    };
    const Tensor grad_F_proj = given(grad[0]), grad_tau = given(grad[1]);
    // The adjoint adds to the gradient of C.
    Tensor grad_F, grad_C, grad_z;
    if (ctx->needs_input_grad(0)) grad_F = torch::empty_like(F);
    if (ctx->needs_input_grad(1)) grad_C = torch::zeros_like(C);
    if (ctx->needs_input_grad(2)) grad_z = torch::zeros_like(z, torch::MemoryFormat::Contiguous);
    if (kernel->wide)
      adjoint(*kernel->wide, F, C, grad_F_proj, grad_tau, grad_F, grad_C, grad_z);
    else
      adjoint(*kernel->narrow, F, C, grad_F_proj, grad_tau, grad_F, grad_C, grad_z);
    return once_differentiable(kOp, {grad_F, grad_C, grad_z, Tensor()});
  }
};

LawOutput apply(const SharedWeights& weights, const Tensor& F, const Tensor& C, const Tensor& z) {
  const auto r = LearnedLawFunction::apply(F, C, z, weights);
  return {r[0], r[1]};
}

}  // namespace

LawOutput learned_law(const SharedWeights& weights, const Tensor& F_trial, const Tensor& C,
                      const Tensor& z) {
  check_arguments(weights, "F_trial", F_trial, C, z);
  if (!C.defined()) check_like(kOp, "C", C, F_trial);
  return apply(weights, F_trial, C, z);
}

Tensor learned_project(const SharedWeights& weights, const Tensor& F, const Tensor& z) {
  check_arguments(weights, "F", F, Tensor(), z);
  return apply(kernels::without_stress(*weights), F, torch::zeros_like(F), z).F_proj;
}

Tensor learned_stress(const SharedWeights& weights, const Tensor& F_proj, const Tensor& C,
                      const Tensor& z) {
  check_arguments(weights, "F_proj", F_proj, C, z);
  if (!C.defined()) check_like(kOp, "C", C, F_proj);
  return apply(kernels::without_projection(*weights), F_proj, C, z).tau;
}

namespace {

SharedWeights shared(const LearnedNetworks& networks) {
  return std::make_shared<LearnedLawWeights>(to_weights(networks));
}

}  // namespace

LawOutput learned_law(const LearnedNetworks& networks, const Tensor& F_trial, const Tensor& C,
                      const Tensor& z) {
  return learned_law(shared(networks), F_trial, C, z);
}

Tensor learned_project(const LearnedNetworks& networks, const Tensor& F, const Tensor& z) {
  return learned_project(shared(networks), F, z);
}

Tensor learned_stress(const LearnedNetworks& networks, const Tensor& F_proj, const Tensor& C,
                      const Tensor& z) {
  return learned_stress(shared(networks), F_proj, C, z);
}

}  // namespace uniphy::ops
