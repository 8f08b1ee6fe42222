#include "ops/rollout/rollout.hpp"

#include <torch/library.h>

#include <string>
#include <tuple>
#include <vector>

#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/library/arguments.hpp"
#include "ops/library/library.hpp"

// The whole roll-out as one op.

namespace uniphy::ops {

using torch::Tensor;

namespace {

using Text = c10::optional<std::string>;

/// The networks that the learned bodies share, where Python has given them all.
struct NetworkArguments {
  const Text &form, &activation;
  const c10::optional<std::vector<std::int64_t>>&projection_widths, &stress_widths;
  const c10::optional<Tensor>&projection, &stress;

  LearnedNetworks networks(const Tensor& z) const {
    if (!form || !activation || !projection_widths || !projection || !stress_widths || !stress)
      throw Error(
          "rollout: a body is learned: expected form, activation, projection_widths, projection, "
          "stress_widths and stress, found None among them");
    return learned_networks("rollout", *form, *activation, *projection_widths, *projection,
                            *stress_widths, *stress, z.numel());
  }
};

/// Bodies with `sizes` particles each, one after the other; without sizes, one has all.
std::vector<RolloutBody> make_bodies(std::int64_t particles, const std::vector<std::string>& laws,
                                     at::TensorList parameters, std::vector<std::int64_t> sizes,
                                     const NetworkArguments& shared) {
  if (sizes.empty() && laws.size() == 1) sizes = {particles};
  if (laws.empty() || parameters.size() != laws.size() || sizes.size() != laws.size())
    throw Error(
        "rollout: expected as many laws as parameters and sizes, one or more (sizes may be left "
        "out for one body), found " +
        std::to_string(laws.size()) + ", " + std::to_string(parameters.size()) + " and " +
        std::to_string(sizes.size()));
  std::vector<RolloutBody> bodies;
  std::ptrdiff_t begin = 0;
  for (std::size_t b = 0; b < laws.size(); ++b) {
    RolloutBody body;
    body.begin = begin;
    body.end = begin += sizes[b];
    body.parameters = parameters[b];
    if (laws[b] == kernels::law_name(kernels::LawId::learned)) {
      body.networks = shared.networks(parameters[b]);
    } else {
      body.law.id = analytic_law("rollout", laws[b]);
    }
    bodies.push_back(std::move(body));
  }
  return bodies;
}

std::tuple<Tensor, Tensor> rollout_op(
    const Tensor& x0, const Tensor& v0, const Tensor& mass, const Tensor& volume,
    const std::vector<std::string>& laws, at::TensorList parameters, std::int64_t steps,
    std::int64_t every, bool velocities, const c10::optional<Tensor>& C0,
    const c10::optional<Tensor>& F0, const std::vector<std::int64_t>& sizes, const Text& form,
    const Text& activation, const c10::optional<std::vector<std::int64_t>>& projection_widths,
    const c10::optional<Tensor>& projection,
    const c10::optional<std::vector<std::int64_t>>& stress_widths,
    const c10::optional<Tensor>& stress, const c10::optional<Tensor>& memory0, std::int64_t n,
    double dt, at::ArrayRef<double> gravity, const std::string& walls, std::int64_t bound) {
  RolloutSettings settings;
  settings.grid = grid_settings("rollout", n, dt, gravity, walls, bound);
  settings.steps = steps;
  settings.every = every;
  settings.velocities = velocities;
  check_tensor("rollout", "x0", x0, real_type("rollout", "x0", x0), {kAnySize, 3});
  const auto bodies =
      make_bodies(x0.size(0), laws, parameters, sizes,
                  {form, activation, projection_widths, stress_widths, projection, stress});
  const RolloutFrames frames = rollout(x0, v0, C0.value_or(Tensor()), F0.value_or(Tensor()), mass,
                                       volume, bodies, settings, memory0.value_or(Tensor()));
  return {frames.x, velocities ? frames.v : x0.new_empty({0, x0.size(0), 3})};
}

}  // namespace

void define_rollout(torch::Library& library) {
  // `steps` MPM steps from x0 [P, 3] m, v0 [P, 3] m/s, C0 [P, 3, 3] 1/s (None: zero), F0 [P, 3, 3]
  // (None: I), memory0 [P] of laws that have one (None: zero); mass [P] kg and volume [P] m³ are
  // constants. laws and parameters: one for each body, an analytic law or "learned" with its code
  // z; sizes: the particles of each body, in order. Learned bodies share the networks. → frames 0,
  // every, 2 every, … ≤ steps: positions [K, P, 3] m and, with velocities, [K, P, 3] m/s, else [0,
  // P, 3]: ops/rollout/rollout.hpp.
  library.def(
      ("rollout(Tensor x0, Tensor v0, Tensor mass, Tensor volume, str[] laws, Tensor[] parameters, "
       "int steps, int every=1, *, bool velocities=False, Tensor? C0=None, Tensor? F0=None, "
       "int[] sizes=[], str? form=None, str? activation=None, int[]? projection_widths=None, "
       "Tensor? projection=None, int[]? stress_widths=None, Tensor? stress=None, Tensor? "
       "memory0=None, " +
       std::string(kGridArguments) + ") -> (Tensor x, Tensor v)")
          .c_str(),
      &rollout_op);
}

}  // namespace uniphy::ops
