#include "ops/library/arguments.hpp"

#include <algorithm>
#include <limits>

#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::ops {
namespace {

/// The same error with the op in front.
template <class Function>
auto naming(const char* op, const Function& function) {
  try {
    return function();
  } catch (const Error& error) {
    throw Error(std::string(op) + ": " + error.what());
  }
}

/// Whole numbers of Python have 64 bits; the nearest int is out of every range that is checked.
int to_int(std::int64_t number) {
  return static_cast<int>(std::clamp<std::int64_t>(number, std::numeric_limits<int>::min(),
                                                   std::numeric_limits<int>::max()));
}

FlatLayers network(const char* op, const char* name, at::IntArrayRef widths,
                   const torch::Tensor& numbers) {
  const std::string title = std::string(name) + "_widths";
  if (widths.size() < 2)
    throw Error(std::string(op) + ": " + title + ": expected two or more, found " +
                std::to_string(widths.size()));
  constexpr std::int64_t kMost = 1 << 20;  // the product of two fits easily
  for (const std::int64_t width : widths) {
    if (width < 1 || width > kMost)
      throw Error(std::string(op) + ": " + title + ": expected numbers from 1 to " +
                  std::to_string(kMost) + ", found " + std::to_string(width));
  }
  std::int64_t count = 0;
  for (std::size_t k = 0; k + 1 < widths.size(); ++k) count += (widths[k] + 1) * widths[k + 1];
  const torch::ScalarType type = real_type(op, name, numbers);
  return {checked(op, name, numbers, type, {count}), widths.vec()};
}

}  // namespace

kernels::GridSettings grid_settings(const char* op, std::int64_t n, double dt,
                                    at::ArrayRef<double> gravity, const std::string& walls,
                                    std::int64_t bound) {
  kernels::GridSettings grid;
  grid.n = to_int(n);
  grid.dt = dt;
  if (gravity.size() != 3)
    throw Error(std::string(op) + ": gravity: expected 3 numbers, found " +
                std::to_string(gravity.size()));
  std::copy(gravity.begin(), gravity.end(), grid.gravity);
  if (walls != "freeslip" && walls != "noslip")
    throw Error(std::string(op) + ": walls: expected \"freeslip\" or \"noslip\", found \"" + walls +
                "\"");
  grid.wall = walls == "noslip" ? kernels::Wall::noslip : kernels::Wall::freeslip;
  grid.bound = to_int(bound);
  naming(op, [&] { grid.check(); });
  return grid;
}

kernels::LawId analytic_law(const char* op, const std::string& name) {
  const kernels::LawId law = naming(op, [&] { return kernels::law_id(name); });
  if (law == kernels::LawId::learned)
    throw Error(std::string(op) + ": law: expected an analytic one, found \"learned\"");
  return law;
}

LearnedNetworks learned_networks(const char* op, const std::string& form,
                                 const std::string& activation, at::IntArrayRef projection_widths,
                                 const torch::Tensor& projection, at::IntArrayRef stress_widths,
                                 const torch::Tensor& stress, std::int64_t latent_size) {
  LearnedNetworks networks;
  networks.form = naming(op, [&] { return kernels::form_from_name(form); });
  networks.activation = naming(op, [&] { return kernels::activation_from_name(activation); });
  networks.latent_size = latent_size;
  networks.projection = network(op, "projection", projection_widths, projection);
  networks.stress = network(op, "stress", stress_widths, stress);
  return networks;
}

}  // namespace uniphy::ops
