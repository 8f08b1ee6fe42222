#pragma once

#include "uniphy/bench/bench_options.hpp"
#include "uniphy/bench/bench_report.hpp"

// One function a subject; each adds its rows to the report. `threads` is what "all threads" means.

namespace uniphy::bench {

/// fp32 multiply-adds and copy bandwidth, into report.machine.
void bench_machine(const BenchOptions& options, int threads, BenchReport& report);
/// 3×3 SVD against torch::linalg_svd.
void bench_svd(const BenchOptions& options, int threads, BenchReport& report);
/// Projection and stress of each analytic law against ops/reference.
void bench_laws(const BenchOptions& options, int threads, BenchReport& report);
/// The learned law in both forms against ops/reference.
void bench_learned(const BenchOptions& options, int threads, BenchReport& report);
/// Steps of a roll-out under a law that costs next to nothing, against ops/reference.
void bench_mpm(const BenchOptions& options, int threads, BenchReport& report);
/// The loss of a whole roll-out and its gradient by the latent, in both forms; then by the weights.
void bench_epoch(const BenchOptions& options, int threads, BenchReport& report);
/// Steps of training against the same objective in plain tensor operations.
void bench_train(const BenchOptions& options, int threads, BenchReport& report);

}  // namespace uniphy::bench
