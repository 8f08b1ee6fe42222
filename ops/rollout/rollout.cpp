#include "ops/rollout/rollout.hpp"

#include <string>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/law_parameters.hpp"
#include "ops/kernels/laws/tracer.hpp"

namespace uniphy::ops {

using kernels::LawId;
using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

/// Which numbers of a body's networks want a gradient, and how many they are.
struct BodyWeights {
  bool projection = false, stress = false;
  std::int64_t projection_size = 0, stress_size = 0;
};

/// What forward leaves for backward. One for each call.
template <class T>
struct Recording : torch::CustomClassHolder {
  explicit Recording(kernels::Rollout<T> r) : rollout(std::move(r)) {}
  kernels::Rollout<T> rollout;
  kernels::RolloutTape<T> tape;
  std::vector<BodyWeights> weights;
};

struct Plan : torch::CustomClassHolder {
  std::vector<RolloutBody> bodies;
  std::vector<BodyWeights> weights;
  RolloutSettings settings;
  bool record = false;  ///< a backward pass may come
};

template <class T>
std::vector<T> to_vector(const Tensor& t) {
  return {t.data_ptr<T>(), t.data_ptr<T>() + t.numel()};
}

/// All parameters of all bodies, one after the other, float64; differentiable.
Tensor pack_parameters(const std::vector<RolloutBody>& bodies) {
  variable_list all;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].tracers) continue;
    const std::string name = "parameters of body " + std::to_string(b);
    const std::int64_t count = kernels::parameter_count(bodies[b].law);
    Tensor values = bodies[b].parameters;
    if (!values.defined()) {
      values = torch::tensor(kernels::parameter_values(bodies[b].law), torch::kFloat64);
    }
    const auto type = real_type("rollout", name.c_str(), values);
    all.push_back(checked("rollout", name.c_str(), values, type, {count}).to(torch::kFloat64));
  }
  if (all.empty()) throw Error("rollout: bodies: expected at least one of material, found none");
  return torch::cat(all);
}

/// All numbers that want a gradient of the networks of all bodies, one after the other, in the
/// dtype of the roll-out; differentiable. The kernels take the numbers themselves from the
/// networks.
Tensor pack_weights(const std::vector<RolloutBody>& bodies, const std::vector<BodyWeights>& wanted,
                    torch::ScalarType type) {
  variable_list all{torch::empty({0}, type)};
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (wanted[b].projection) all.push_back(bodies[b].networks.projection.numbers.to(type));
    if (wanted[b].stress) all.push_back(bodies[b].networks.stress.numbers.to(type));
  }
  return torch::cat(all);
}

/// The gradient of pack_weights.
template <class T>
Tensor weight_gradient(const std::vector<std::vector<T>>& of_bodies,
                       const std::vector<BodyWeights>& wanted) {
  std::vector<T> all;
  for (std::size_t b = 0; b < of_bodies.size(); ++b) {
    const auto stress = of_bodies[b].end() - (wanted[b].stress ? wanted[b].stress_size : 0);
    if (wanted[b].projection)
      all.insert(all.end(), of_bodies[b].begin(), of_bodies[b].begin() + wanted[b].projection_size);
    all.insert(all.end(), stress, of_bodies[b].end());
  }
  return torch::tensor(all, c10::CppTypeToScalarType<T>::value);
}

template <class T>
kernels::Rollout<T> make_rollout(const Plan& plan, const Tensor& parameters, const Tensor& mass,
                                 const Tensor& volume) {
  const double* values = parameters.data_ptr<double>();
  std::vector<kernels::BodyRange<T>> ranges;
  for (const RolloutBody& body : plan.bodies) {
    if (body.tracers) {
      ranges.push_back({body.begin, body.end, std::make_shared<const kernels::Tracer<T>>()});
      continue;
    }
    ranges.push_back(
        {body.begin, body.end, kernels::make_law<T>(kernels::with_parameters(body.law, values))});
    values += kernels::parameter_count(body.law);
  }
  return {plan.settings.grid, ranges, to_vector<T>(mass), to_vector<T>(volume)};
}

class RolloutFunction : public torch::autograd::Function<RolloutFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& x, const Tensor& v,
                               const Tensor& C, const Tensor& F, const Tensor& memory,
                               const Tensor& parameters, const Tensor& /*weights: for the graph*/,
                               const Tensor& mass, const Tensor& volume,
                               const c10::intrusive_ptr<Plan>& plan) {
    const RolloutSettings& settings = plan->settings;
    const std::int64_t frames =
        kernels::Rollout<double>::frame_count(settings.steps, settings.every);
    const Tensor frames_x = torch::empty({frames, x.size(0), 3}, x.options());
    const Tensor frames_v =
        settings.velocities ? torch::empty_like(frames_x) : torch::empty({0}, x.options());
    for_real_type(x.scalar_type(), [&](auto real) {
      using T = decltype(real);
      auto recording = c10::make_intrusive<Recording<T>>(
          make_rollout<T>(*plan, parameters.detach(), mass, volume));
      recording->rollout.record({to_vector<T>(x), to_vector<T>(v), to_vector<T>(C), to_vector<T>(F),
                                 to_vector<T>(memory)},
                                settings.steps, settings.every, frames_x.template data_ptr<T>(),
                                settings.velocities ? frames_v.template data_ptr<T>() : nullptr,
                                plan->record ? &recording->tape : nullptr);
      recording->weights = plan->weights;
      ctx->saved_data["recording"] = torch::IValue::make_capsule(recording);
    });
    ctx->saved_data["double"] = x.scalar_type() == torch::kFloat64;
    ctx->set_materialize_grads(false);
    return {frames_x, frames_v};
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad_out) {
    variable_list grad(10);
    const bool is_double = ctx->saved_data["double"].toBool();
    if (grad_out[1].defined() && grad_out[1].numel() == 0) grad_out[1] = Tensor();
    if (!grad_out[0].defined() && !grad_out[1].defined()) return grad;
    for_real_type(is_double ? torch::kFloat64 : torch::kFloat32, [&](auto real) {
      using T = decltype(real);
      const auto recording = c10::static_intrusive_pointer_cast<Recording<T>>(
          ctx->saved_data["recording"].toCapsule());
      std::vector<bool> of_weights;
      for (const BodyWeights& w : recording->weights)
        of_weights.push_back(ctx->needs_input_grad(6) && (w.projection || w.stress));
      const kernels::RolloutGradient<T> g =
          recording->rollout.adjoint(recording->tape, gradient_data<T>(grad_out[0]),
                                     gradient_data<T>(grad_out[1]), of_weights);
      const std::int64_t P = recording->rollout.particles();
      const auto type = is_double ? torch::kFloat64 : torch::kFloat32;
      const auto put = [&](int i, const std::vector<T>& values, at::IntArrayRef sizes) {
        if (!ctx->needs_input_grad(i)) return;
        grad[i] = torch::empty(sizes, type);
        std::copy(values.begin(), values.end(), grad[i].template data_ptr<T>());
      };
      put(0, g.state.x, {P, 3});
      put(1, g.state.v, {P, 3});
      put(2, g.state.C, {P, 3, 3});
      put(3, g.state.F, {P, 3, 3});
      // Empty where no law has memory, and then it is not differentiated.
      if (!g.state.memory.empty()) put(4, g.state.memory, {P});
      if (ctx->needs_input_grad(5)) {
        std::vector<double> all;
        for (const auto& body : g.parameters) all.insert(all.end(), body.begin(), body.end());
        grad[5] = torch::tensor(all, torch::kFloat64);
      }
      if (ctx->needs_input_grad(6)) grad[6] = weight_gradient(g.weights, recording->weights);
    });
    return once_differentiable("rollout", std::move(grad));
  }
};

}  // namespace

RolloutFrames rollout(const Tensor& x0, const Tensor& v0, const Tensor& C0, const Tensor& F0,
                      const Tensor& mass, const Tensor& volume,
                      const std::vector<RolloutBody>& bodies, const RolloutSettings& settings,
                      const Tensor& memory0) {
  const auto type = real_type("rollout", "x0", x0);
  const Tensor x = checked("rollout", "x0", x0, type, {kAnySize, 3});
  const std::int64_t P = x.size(0);
  if (settings.steps < 0 || settings.every < 1) {
    throw Error("rollout: expected steps >= 0 and every >= 1, found " +
                std::to_string(settings.steps) + " and " + std::to_string(settings.every));
  }
  const Tensor C = C0.defined() ? checked("rollout", "C0", C0, type, {P, 3, 3})
                                : torch::zeros({P, 3, 3}, x.options().requires_grad(false));
  const Tensor F =
      F0.defined() ? checked("rollout", "F0", F0, type, {P, 3, 3})
                   : torch::eye(3, x.options().requires_grad(false)).expand({P, 3, 3}).contiguous();
  const std::int64_t end = bodies.empty() ? 0 : bodies.back().end;
  if (end != P) {
    throw Error("rollout: bodies: expected the last one to end at particle " + std::to_string(P) +
                ", found " + std::to_string(end));
  }
  for (std::size_t b = 1; b < bodies.size(); ++b) {
    if (bodies[b].tracers || !bodies[b - 1].tracers) continue;
    throw Error("rollout: bodies: expected tracers after all material, found material in body " +
                std::to_string(b));
  }
  auto plan = c10::make_intrusive<Plan>();
  plan->bodies = bodies;
  for (RolloutBody& body : plan->bodies) {
    BodyWeights& wanted = plan->weights.emplace_back();
    if (body.tracers) {
      body.networks = {};
      body.law = {};
    }
    if (!body.networks.defined()) continue;
    const std::string op = "rollout: body " + std::to_string(plan->weights.size() - 1);
    check_networks(op.c_str(), body.networks);
    const Tensor &projection = body.networks.projection.numbers,
                 &stress = body.networks.stress.numbers;
    wanted = {projection.requires_grad(), stress.requires_grad(), projection.numel(),
              stress.numel()};
    body.law.id = LawId::learned;
    body.law.weights = kernel_weights(body.networks);
  }
  plan->settings = settings;
  const Tensor packed = pack_parameters(plan->bodies);
  const Tensor weights = pack_weights(plan->bodies, plan->weights, type);
  for (RolloutBody& body : plan->bodies) {  // the two carry them
    body.parameters = Tensor();
    body.networks = {};
  }
  const Tensor v = checked("rollout", "v0", v0, type, {P, 3});
  const Tensor m = checked("rollout", "mass", mass, type, {P}).detach();
  const Tensor V = checked("rollout", "volume", volume, type, {P}).detach();
  const Tensor memory = memory0.defined() ? checked("rollout", "memory0", memory0, type, {P})
                                          : torch::empty({0}, x.options().requires_grad(false));
  for (const Tensor& t : {x, v, C, F, memory, packed, weights})
    plan->record = plan->record || t.requires_grad();
  plan->record = plan->record && torch::GradMode::is_enabled();
  const variable_list out = RolloutFunction::apply(x, v, C, F, memory, packed, weights, m, V, plan);
  return {out[0], settings.velocities ? out[1] : Tensor()};
}

}  // namespace uniphy::ops
