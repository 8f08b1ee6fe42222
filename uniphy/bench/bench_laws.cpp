
#include "ops/base/torch.hpp"
#include "ops/laws/kirchhoff_stress.hpp"
#include "ops/laws/return_mapping.hpp"
#include "ops/reference/kirchhoff_stress.hpp"
#include "ops/reference/return_mapping.hpp"
#include "uniphy/bench/subjects.hpp"

namespace uniphy::bench {
namespace {

using torch::Tensor;

constexpr double kStep = 5e-4;  // s

/// F → F_proj by the ops or by their references; a law with memory begins without.
Tensor projected(kernels::LawId id, const ops::Material& material, const Tensor& F, bool plain) {
  if (!kernels::law_has_memory(id)) {
    return (plain ? ops::reference::return_mapping : ops::return_mapping)(id, F, material, kStep);
  }
  const Tensor memory = torch::zeros({F.size(0)}, F.options().requires_grad(false));
  return plain ? ops::reference::return_mapping_with_memory(id, F, memory, material).F_proj
               : ops::return_mapping_with_memory(id, F, memory, material, kStep).F_proj;
}

/// F → F_proj, τ by the ops or by their references.
std::vector<Tensor> law(kernels::LawId id, const ops::Material& material, const Tensor& F,
                        const Tensor& C, bool plain) {
  const Tensor F_proj = projected(id, material, F, plain);
  return {F_proj, (plain ? ops::reference::kirchhoff_stress : ops::kirchhoff_stress)(id, F_proj, C,
                                                                                     material)};
}

}  // namespace

void bench_laws(const BenchOptions& options, int threads, BenchReport& report) {
  const std::int64_t n = options.law_particles;
  torch::manual_seed(2);
  // Strains on both sides of the yield surfaces.
  const Tensor F = (torch::eye(3) + 0.1 * torch::randn({n, 3, 3})).requires_grad_();
  const Tensor C = torch::randn({n, 3, 3}).requires_grad_();
  const std::vector<Tensor> grad{torch::randn({n, 3, 3}), torch::randn({n, 3, 3})};
  const ops::Material material{1e5, 2e5, 5e3, 0.3, 10.0, 1e5, 1e4, 1.0, 0.1, 0.6, 0.02};
  for (const std::string& name : options.laws) {
    const kernels::LawId id = kernels::law_id(name);
    Measurer measurer(threads);
    std::vector<Tensor> outputs[2];
    for (const bool plain : {false, true}) {
      std::vector<Tensor>& out = outputs[plain ? 1 : 0];
      out = law(id, material, F, C, plain);
      const auto forward = [&, id, plain] {
        const torch::NoGradGuard no_grad;
        law(id, material, F, C, plain);
      };
      const auto backward = [&out, &F, &C, &grad] {
        torch::autograd::grad(out, {F, C}, grad, /*retain_graph=*/true, /*create_graph=*/false,
                              /*allow_unused=*/true);
      };
      plain ? measurer.add_baseline("forward", forward) : measurer.add("forward", forward);
      plain ? measurer.add_baseline("backward", backward) : measurer.add("backward", backward);
    }
    measurer.run(options.effort);
    for (const char* pass : {"forward", "backward"}) {
      report.rows.push_back(
          make_row(measurer, pass, "law " + name, pass, n, static_cast<double>(n)));
    }
  }
}

}  // namespace uniphy::bench
