#pragma once

#include <ATen/CPUGeneratorImpl.h>

#include <cstdint>
#include <vector>

#include "ops/base/torch.hpp"

namespace uniphy {

/// Draws samples for every trajectory. Stateless: the rows of step k depend on the seed and k
/// alone, so that a resumed run draws what the uninterrupted one would have.
class BatchSampler {
 public:
  /// The samples of trajectory i are first[i] ... first[i + 1] - 1.
  BatchSampler(const std::vector<std::int64_t>& first, std::uint64_t seed) : seed_(seed) {
    const std::int64_t n = std::int64_t(first.size()) - 1;
    first_ = torch::empty({n, 1}, torch::kFloat64);
    count_ = torch::empty({n, 1}, torch::kFloat64);
    for (std::int64_t i = 0; i < n; ++i) {
      first_[i][0] = double(first[i]);
      count_[i][0] = double(first[i + 1] - first[i]);
    }
  }

  std::int64_t trajectories() const { return first_.size(0); }

  /// [N, m] rows of the sample table.
  torch::Tensor rows(std::int64_t step, std::int64_t m) const {
    // Two odd constants spread neighbouring steps over the generator's seeds.
    torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(
        seed_ * 0x9E3779B97F4A7C15ULL + std::uint64_t(step) * 0xD1B54A32D192ED03ULL);
    const torch::Tensor u = torch::rand({first_.size(0), m}, generator, torch::kFloat64);
    return (first_ + (u * count_).floor()).to(torch::kInt64);
  }

 private:
  std::uint64_t seed_;
  torch::Tensor first_, count_;
};

}  // namespace uniphy
