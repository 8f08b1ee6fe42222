#include <torch/torch.h>

#include "ops/learned_law.hpp"
#include "ops/reference/learned_law.hpp"
#include "uniphy/bench/random_law.hpp"
#include "uniphy/bench/subjects.hpp"

namespace uniphy::bench {
namespace {

using torch::Tensor;

void bench_size(const BenchOptions& options, kernels::LawForm form, std::int64_t n, int threads,
                BenchReport& report) {
  const auto weights = random_law(form);
  const auto plain = ops::reference::to_tensors(*weights, torch::kFloat32);
  torch::manual_seed(3);
  const Tensor F = (torch::eye(3) + 0.1 * torch::randn({n, 3, 3})).requires_grad_();
  const Tensor C = torch::randn({n, 3, 3}).requires_grad_();
  const Tensor z =
      torch::tensor(random_code(*weights), torch::kFloat64).to(torch::kFloat32).requires_grad_();
  const std::vector<Tensor> grad{torch::randn({n, 3, 3}), torch::randn({n, 3, 3})};

  const auto run_ours = [&]() -> std::vector<Tensor> {
    const ops::LawOutput out = ops::learned_law(weights, F, C, z);
    return {out.F_proj, out.tau};
  };
  const auto run_plain = [&]() -> std::vector<Tensor> {
    const Tensor F_proj = ops::reference::learned_project(plain, F, z);
    return {F_proj, ops::reference::learned_stress(plain, F_proj, C, z)};
  };
  const std::vector<Tensor> out_ours = run_ours(), out_plain = run_plain();
  const auto backward = [&](const std::vector<Tensor>& out) {
    torch::autograd::grad(out, {F, C, z}, grad, /*retain_graph=*/true, /*create_graph=*/false,
                          /*allow_unused=*/true);
  };
  Measurer measurer(threads);
  measurer.add("forward", [&] {
    const torch::NoGradGuard no_grad;
    run_ours();
  });
  measurer.add("backward", [&] { backward(out_ours); });
  measurer.add_baseline("forward", [&] {
    const torch::NoGradGuard no_grad;
    run_plain();
  });
  measurer.add_baseline("backward", [&] { backward(out_plain); });
  measurer.run(options.effort);

  const double flops = 2 * multiply_adds_of(*weights);
  for (const char* pass : {"forward", "backward"}) {
    BenchRow row = make_row(measurer, pass, std::string("learned ") + kernels::form_name(form),
                            pass, n, static_cast<double>(n));
    const bool back = pass[0] == 'b';
    // Backwards the activations are computed once more, then the gradient goes down the layers.
    // Only the networks are counted.
    row.flops = back ? 2 * flops : flops;
    row.bytes = (back ? 6 : 4) * 9 * sizeof(float);
    report.rows.push_back(row);
  }
}

}  // namespace

void bench_learned(const BenchOptions& options, int threads, BenchReport& report) {
  for (const auto form : {kernels::LawForm::seed, kernels::LawForm::isotropic}) {
    for (const std::int64_t n : options.learned_particles) {
      bench_size(options, form, n, threads, report);
    }
  }
}

}  // namespace uniphy::bench
