
#include <algorithm>

#include "ops/base/torch.hpp"
#include "ops/kernels/laws/law.hpp"
#include "ops/reference/learned_law.hpp"
#include "uniphy/bench/random_law.hpp"
#include "uniphy/bench/subjects.hpp"

namespace uniphy::bench {
namespace {

using torch::Tensor;

/// Matrices in chunks of planes, as a roll-out keeps them.
class Planes {
 public:
  explicit Planes(std::int64_t n) : numbers_(chunks(n) * kChunkSize, 0.0F) {}
  explicit Planes(const Tensor& rows) : Planes(rows.size(0)) {
    const Tensor flat = rows.detach().contiguous();
    for (std::int64_t p = 0; p < flat.size(0); ++p) {
      for (int k = 0; k < 9; ++k) {
        numbers_[p / kernels::kLawChunk * kChunkSize + k * kernels::kLawChunk +
                 p % kernels::kLawChunk] = flat.data_ptr<float>()[9 * p + k];
      }
    }
  }
  static std::int64_t chunks(std::int64_t n) {
    return (n + kernels::kLawChunk - 1) / kernels::kLawChunk;
  }
  kernels::View<float> chunk(std::int64_t c) {
    return {numbers_.data() + c * kChunkSize, 1, kernels::kLawChunk};
  }

 private:
  static constexpr std::int64_t kChunkSize = 9 * kernels::kLawChunk;
  std::vector<float> numbers_;
};

/// A law prepared once, the latent folded in, on chunks of particles: what a roll-out does with it
/// in every step.
struct OurLaw {
  OurLaw(const kernels::LawDescription& description, const Tensor& F, const Tensor& C,
         const std::vector<Tensor>& grad)
      : law(kernels::make_law<float>(description)),
        n(F.size(0)),
        F(F),
        C(C),
        grad_F_proj(grad[0]),
        grad_tau(grad[1]),
        F_proj(n),
        tau(n),
        grad_F(n),
        grad_C(n),
        sums(Planes::chunks(n) * law->accumulator_size()),
        grad_z(law->parameter_size()) {}

  std::int64_t count(std::int64_t c) const {
    return std::min<std::int64_t>(kernels::kLawChunk, n - c * kernels::kLawChunk);
  }
  void forward() {
#pragma omp parallel for schedule(static)
    for (std::int64_t c = 0; c < Planes::chunks(n); ++c) {
      law->evaluate(count(c), 5e-4F, F.chunk(c), C.chunk(c), F_proj.chunk(c), tau.chunk(c));
    }
  }
  void backward() {
    const std::ptrdiff_t size = law->accumulator_size();
    std::fill(sums.begin(), sums.end(), 0.0F);
#pragma omp parallel for schedule(static)
    for (std::int64_t c = 0; c < Planes::chunks(n); ++c) {
      law->adjoint(count(c), 5e-4F, F.chunk(c), C.chunk(c), grad_F_proj.chunk(c), grad_tau.chunk(c),
                   grad_F.chunk(c), grad_C.chunk(c), sums.data() + c * size);
    }
    for (std::int64_t c = 1; c < Planes::chunks(n); ++c) {
      for (std::ptrdiff_t k = 0; k < size; ++k) sums[k] += sums[c * size + k];
    }
    law->parameter_gradient(sums.data(), grad_z.data());
  }

  std::shared_ptr<const kernels::LawKernel<float>> law;
  std::int64_t n;
  Planes F, C, grad_F_proj, grad_tau, F_proj, tau, grad_F, grad_C;
  std::vector<float> sums, grad_z;
};

void bench_size(const BenchOptions& options, kernels::LawForm form, std::int64_t n, int threads,
                BenchReport& report) {
  kernels::LawDescription description;
  description.id = kernels::LawId::learned;
  description.weights = random_law(form);
  description.z = random_code(*description.weights);
  const auto& weights = description.weights;
  const auto plain = ops::to_networks(*weights, torch::kFloat32);
  torch::manual_seed(3);
  const Tensor F = (torch::eye(3) + 0.1 * torch::randn({n, 3, 3})).requires_grad_();
  const Tensor C = torch::randn({n, 3, 3}).requires_grad_();
  const Tensor z =
      torch::tensor(description.z, torch::kFloat64).to(torch::kFloat32).requires_grad_();
  const std::vector<Tensor> grad{torch::randn({n, 3, 3}), torch::randn({n, 3, 3})};
  OurLaw ours(description, F, C, grad);
  const auto run_plain = [&]() -> std::vector<Tensor> {
    const Tensor F_proj = ops::reference::learned_project(plain, F, z);
    return {F_proj, ops::reference::learned_stress(plain, F_proj, C, z)};
  };
  const std::vector<Tensor> out = run_plain();
  Measurer measurer(threads);
  measurer.add("forward", [&] { ours.forward(); });
  measurer.add("backward", [&] { ours.backward(); });
  measurer.add_baseline("forward", [&] {
    const torch::NoGradGuard no_grad;
    run_plain();
  });
  measurer.add_baseline("backward", [&] {
    torch::autograd::grad(out, {F, C, z}, grad, /*retain_graph=*/true, /*create_graph=*/false,
                          /*allow_unused=*/true);
  });
  // The value and the gradient together, what an optimizer's step pays: here autograd builds its
  // graph and keeps the activations, which ours computes again.
  measurer.add("both", [&] {
    ours.forward();
    ours.backward();
  });
  measurer.add_baseline("both", [&] {
    torch::autograd::grad(run_plain(), {F, C, z}, grad, /*retain_graph=*/false);
  });
  measurer.run(options.effort);

  const double flops = 2 * multiply_adds_of(*weights);
  struct Pass {
    const char* name;
    int networks;  ///< times that the networks' products are done
    int matrices;  ///< read and written
  };
  // Backwards the activations are computed once more, then the gradient goes down the layers.
  for (const Pass& pass : {Pass{"forward", 1, 4}, {"backward", 2, 6}, {"both", 3, 10}}) {
    BenchRow row = make_row(measurer, pass.name, std::string("learned ") + kernels::form_name(form),
                            pass.name, n, static_cast<double>(n));
    row.flops = pass.networks * flops;
    row.bytes = pass.matrices * 9 * sizeof(float);
    report.rows.push_back(row);
  }
}

}  // namespace

void bench_learned(const BenchOptions& options, int threads, BenchReport& report) {
  for (const auto form : {kernels::LawForm::published, kernels::LawForm::isotropic}) {
    for (const std::int64_t n : options.learned_particles) {
      bench_size(options, form, n, threads, report);
    }
  }
}

}  // namespace uniphy::bench
