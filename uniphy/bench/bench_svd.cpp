
#include "ops/base/torch.hpp"
#include "ops/spectral/svd3.hpp"
#include "uniphy/bench/subjects.hpp"

namespace uniphy::bench {
namespace {

void bench_dtype(const BenchOptions& options, torch::Dtype dtype, const std::string& work,
                 int threads, BenchReport& report) {
  const std::int64_t n = options.svd_matrices;
  torch::manual_seed(1);
  const torch::Tensor F =
      (torch::eye(3, torch::kFloat64) + 0.3 * torch::randn({n, 3, 3}, torch::kFloat64)).to(dtype);
  Measurer measurer(threads);
  measurer.add(work, [&] {
    const torch::NoGradGuard no_grad;
    ops::svd3(F);
  });
  measurer.add_baseline(work, [&] {
    const torch::NoGradGuard no_grad;
    torch::linalg_svd(F, /*full_matrices=*/false);
  });
  measurer.run(options.effort);
  BenchRow row = make_row(measurer, work, work, "forward", n, static_cast<double>(n));
  // Nominal: four sweeps of three rotations of about 70 flops, and the norms, signs and order.
  row.flops = 4 * 3 * 70 + 100;
  row.bytes = (9 + 21) * static_cast<double>(torch::elementSize(dtype));
  report.rows.push_back(row);
}

}  // namespace

void bench_svd(const BenchOptions& options, int threads, BenchReport& report) {
  bench_dtype(options, torch::kFloat32, "svd3 f32", threads, report);
  bench_dtype(options, torch::kFloat64, "svd3 f64", threads, report);
}

}  // namespace uniphy::bench
