#include "models/latent_codes.hpp"

#include <utility>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::models {
LatentCodesImpl::LatentCodesImpl(const torch::Tensor& initial, std::vector<std::string> materials,
                                 std::vector<CodeParameters> parameters)
    : materials_(std::move(materials)), parameters_(std::move(parameters)) {
  const auto expect_rows = [&](const char* what, std::size_t found) {
    if (std::int64_t(found) != initial.size(0))
      throw Error(std::string("latent codes: ") + what + ": expected " +
                  std::to_string(initial.size(0)) + " rows, one for each code, found " +
                  std::to_string(found));
  };
  expect_rows("materials", materials_.size());
  expect_rows("parameters", parameters_.size());
  z = register_parameter("z", initial.detach().clone());
}

}  // namespace uniphy::models
