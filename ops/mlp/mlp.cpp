#include "ops/mlp/mlp.hpp"

#include <algorithm>
#include <sstream>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/plain_tensors.hpp"
#include "ops/base/planes.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/learned/learned_law_table.hpp"
#include "ops/kernels/simd/aligned_buffer.hpp"
#include "ops/mlp/mlp_problem.hpp"

namespace uniphy::ops {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// Tiles are dealt to this many running sums, whatever the thread count, which are then added in
/// order: the same bits on one thread and on several.
constexpr std::int64_t kSums = 8;

std::string shape_of(const torch::Tensor& t) {
  std::ostringstream text;
  if (!t.defined()) return "an undefined tensor";
  text << t.scalar_type() << " " << t.sizes();
  return text.str();
}

void check_layers(std::int64_t in, torch::ScalarType type, const std::vector<LinearLayer>& layers) {
  if (layers.empty()) throw Error("mlp: expected at least one layer");
  for (std::size_t k = 0; k < layers.size(); ++k) {
    const torch::Tensor &w = layers[k].weight, &b = layers[k].bias;
    const bool fits = w.dim() == 2 && w.size(1) == in && b.dim() == 1 && b.size(0) == w.size(0) &&
                      w.scalar_type() == type && b.scalar_type() == type;
    if (!fits)
      throw Error("mlp: layer " + std::to_string(k) + ": expected a weight [out, " +
                  std::to_string(in) + "] and a bias [out] of type " +
                  std::string(torch::toString(type)) + ", found " + shape_of(w) + " and " +
                  shape_of(b));
    in = w.size(0);
  }
}

void check(const torch::Tensor& x, const std::vector<LinearLayer>& layers) {
  real_type("mlp", "x", x);
  if (x.dim() != 2) throw Error("mlp: x: expected [samples, features], found " + shape_of(x));
  check_layers(x.size(1), x.scalar_type(), layers);
}

void check(const torch::Tensor& features, const torch::Tensor& z) {
  real_type("mlp", "features", features);
  if (features.dim() != 3)
    throw Error("mlp: features: expected [codes, samples, features], found " + shape_of(features));
  if (z.dim() != 2 || z.size(0) != features.size(0) || z.scalar_type() != features.scalar_type())
    throw Error("mlp: z: expected [" + std::to_string(features.size(0)) + ", any] of type " +
                std::string(torch::toString(features.scalar_type())) + ", found " + shape_of(z));
}

void check(const torch::Tensor& features, const torch::Tensor& z,
           const std::vector<LinearLayer>& layers) {
  check(features, z);
  check_layers(features.size(2) + z.size(1), features.scalar_type(), layers);
}

void check(const torch::Tensor& features, const torch::Tensor& z, const FlatLayers& flat) {
  check(features, z);
  std::int64_t numbers = 0;
  for (std::size_t k = 0; k + 1 < flat.widths.size(); ++k)
    numbers += (flat.widths[k] + 1) * flat.widths[k + 1];
  const std::int64_t in = features.size(2) + z.size(1);
  if (flat.widths.size() < 2 || flat.widths.front() != in)
    throw Error("mlp: layers: expected one or more, the first of which takes " +
                std::to_string(in) + " numbers, found " +
                (flat.widths.empty() ? std::string("none") : std::to_string(flat.widths.front())));
  if (flat.numbers.dim() != 1 || flat.numbers.numel() != numbers ||
      flat.numbers.scalar_type() != features.scalar_type())
    throw Error("mlp: layers: expected [" + std::to_string(numbers) + "] numbers of type " +
                std::string(torch::toString(features.scalar_type())) + ", found " +
                shape_of(flat.numbers));
}

template <class T>
MlpProblem<T> problem_of(const torch::Tensor& features, const torch::Tensor& z,
                         const torch::Tensor& flat, const std::vector<std::int64_t>& widths,
                         kernels::Activation activation) {
  return {features.size(0), features.size(1), z.size(1), flat.data_ptr<T>(), widths, activation};
}

/// For f numbers a sample, in the order of memory of `samples`: planes or rows.
torch::Tensor like_samples(const torch::Tensor& samples, std::int64_t f) {
  const std::int64_t n = samples.size(0), m = samples.size(1);
  const bool planes = m > 1 && samples.stride(1) == 1;
  return planes ? empty_planes({n, m, f}, samples.options())
                : torch::empty({n, m, f}, samples.options());
}

template <class T>
torch::Tensor forward(const MlpProblem<T>& problem, const torch::Tensor& features,
                      const torch::Tensor& z) {
  const auto& table = kernels::learned_law_table<T>();
  const kernels::PackedMlp<T>& net = problem.net();
  const torch::Tensor y = like_samples(features, net.out());
  const SamplesView<const T> from(features);
  const SamplesView<T> to(y);
  const T* codes = z.data_ptr<T>();
  const std::int64_t plane = std::int64_t(net.max_width) * kTile;
#pragma omp parallel
  {
    MlpOfCode<T> folded(problem);
    kernels::AlignedBuffer<T> buffer(plane + net.forward_scratch());
    T *in = buffer.data(), *scratch = in + plane;
#pragma omp for schedule(static)
    for (std::int64_t t = 0; t < problem.tiles(); ++t) {
      const auto& of_code = folded.of_code(codes + problem.code(t) * problem.latent);
      to_tile(problem, from, t, net.in(), in);
      from_tile(problem, table.mlp_forward(of_code, in, scratch), t, net.out(), to);
    }
  }
  return y;
}

/// Gradients of the features, z and the flat weights, each where it is wanted.
template <class T>
variable_list backward(const MlpProblem<T>& problem, const torch::Tensor& features,
                       const torch::Tensor& z, const torch::Tensor& flat, const torch::Tensor& grad,
                       bool want_features, bool want_z, bool want_weights) {
  const auto& table = kernels::learned_law_table<T>();
  const kernels::PackedMlp<T>& net = problem.net();
  const std::int64_t tiles = problem.tiles(), width = problem.first_width();
  const std::int64_t latent = problem.latent, n_in = net.in();
  const std::int64_t plane = std::int64_t(net.max_width) * kTile;
  const std::int64_t sums = want_weights ? std::min(kSums, tiles) : kSums;
  const std::int64_t sums_size = net.weight_sums();
  torch::Tensor grad_features, grad_z, grad_flat;
  if (want_features) grad_features = like_samples(features, n_in);
  kernels::AlignedBuffer<T> partial(want_weights ? sums * sums_size : 0);
  partial.fill(T(0));
  const bool want_bias = latent > 0 && (want_z || want_weights);
  std::vector<T> first_bias(want_bias ? std::size_t(tiles * width) : 0, T(0));
  const SamplesView<const T> from(features), of_out(grad);
  const SamplesView<T> to_features(grad_features);
  const T* codes = z.data_ptr<T>();
#pragma omp parallel
  {
    MlpOfCode<T> folded(problem);
    kernels::AlignedBuffer<T> scratch(3 * plane + net.tape_scratch());
    T *in = scratch.data(), *grad_out = in + plane, *grad_in = grad_out + plane,
      *tape = grad_in + plane;
#pragma omp for schedule(static)
    for (std::int64_t sum = 0; sum < sums; ++sum) {
      T* const weights = want_weights ? partial.data() + sum * sums_size : nullptr;
      for (std::int64_t t = sum * tiles / sums; t < (sum + 1) * tiles / sums; ++t) {
        const auto& of_code = folded.of_code(codes + problem.code(t) * latent);
        to_tile(problem, from, t, n_in, in);
        to_tile(problem, of_out, t, net.out(), grad_out);
        table.mlp_tape(of_code, in, tape);
        table.mlp_backward(of_code, in, tape, grad_out, want_features ? grad_in : nullptr,
                           want_bias ? first_bias.data() + t * width : nullptr, weights);
        if (want_features) from_tile(problem, grad_in, t, n_in, to_features);
      }
    }
  }
  // The gradient of the first bias, of every code in its first tile.
  for (std::int64_t t = 0; want_bias && t < tiles; ++t) {
    const std::int64_t to = problem.code(t) * problem.tiles_per_code;
    for (std::int64_t o = 0; t != to && o < width; ++o)
      first_bias[to * width + o] += first_bias[t * width + o];
  }
  const auto bias_of = [&](std::int64_t code) {
    return first_bias.data() + code * problem.tiles_per_code * width;
  };
  if (want_z) {
    grad_z = torch::zeros_like(z);
    T* to = grad_z.data_ptr<T>();
    for (std::int64_t i = 0; want_bias && i < problem.codes; ++i)
      for (std::int64_t o = 0; o < width; ++o)
        for (std::int64_t k = 0; k < latent; ++k)
          to[i * latent + k] += bias_of(i)[o] * problem.latent_weight(o)[k];
  }
  if (want_weights) {
    grad_flat = torch::zeros_like(flat);
    T* to = grad_flat.data_ptr<T>();
    for (std::int64_t i = 0; want_bias && i < problem.codes; ++i)
      for (std::int64_t o = 0; o < width; ++o)
        for (std::int64_t k = 0; k < latent; ++k)
          to[o * problem.in() + n_in + k] += bias_of(i)[o] * codes[i * latent + k];
    for (std::int64_t sum = 0; sum < sums; ++sum)
      problem.packed().add_weight_gradient(partial.data() + sum * sums_size, to);
  }
  return {grad_features, grad_z, grad_flat};
}

struct MlpFunction : torch::autograd::Function<MlpFunction> {
  static torch::Tensor forward(AutogradContext* ctx, const torch::Tensor& features,
                               const torch::Tensor& z, const torch::Tensor& flat,
                               std::vector<std::int64_t> widths, std::int64_t activation) {
    ctx->save_for_backward({features, z, flat});
    ctx->saved_data["widths"] = widths;
    ctx->saved_data["activation"] = activation;
    torch::Tensor y;
    for_real_type(features.scalar_type(), [&](auto zero) {
      const auto problem = problem_of<decltype(zero)>(features, z, flat, widths,
                                                      static_cast<kernels::Activation>(activation));
      y = ops::forward(problem, features, z);
    });
    return y;
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    variable_list result(5);
    if (!grads[0].defined()) return result;
    const variable_list saved = ctx->get_saved_variables();
    const torch::Tensor &features = saved[0], &z = saved[1], &flat = saved[2], grad = grads[0];
    const std::vector<std::int64_t> widths = ctx->saved_data["widths"].toIntVector();
    const auto activation = static_cast<kernels::Activation>(ctx->saved_data["activation"].toInt());
    for_real_type(features.scalar_type(), [&](auto zero) {
      const auto problem = problem_of<decltype(zero)>(features, z, flat, widths, activation);
      const variable_list g =
          ops::backward(problem, features, z, flat, grad, ctx->needs_input_grad(0),
                        ctx->needs_input_grad(1), ctx->needs_input_grad(2));
      std::copy(g.begin(), g.end(), result.begin());
    });
    return once_differentiable("mlp", std::move(result));
  }
};

torch::Tensor apply(const torch::Tensor& features, const torch::Tensor& z, const FlatLayers& flat,
                    kernels::Activation activation) {
  return MlpFunction::apply(features, z.contiguous(), flat.numbers.contiguous(), flat.widths,
                            static_cast<std::int64_t>(activation));
}

/// z beside every sample: [codes, samples, features + latent].
torch::Tensor beside(const torch::Tensor& features, const torch::Tensor& z) {
  const torch::Tensor every =
      z.unsqueeze(1).expand({features.size(0), features.size(1), z.size(1)});
  return torch::cat({features, every}, 2);
}

torch::Tensor activate(const torch::Tensor& x, kernels::Activation activation) {
  switch (activation) {
    case kernels::Activation::gelu:
      return torch::gelu(x);
    case kernels::Activation::silu:
      return torch::silu(x);
    case kernels::Activation::squareplus:
      break;
  }
  return 0.5 * (x + torch::sqrt(x * x + 4.0)) - 1.0;
}

}  // namespace

std::vector<LinearLayer> layers_of(const FlatLayers& flat) {
  std::vector<LinearLayer> layers;
  std::int64_t at = 0;
  for (std::size_t k = 0; k + 1 < flat.widths.size(); ++k) {
    const std::int64_t in = flat.widths[k], out = flat.widths[k + 1];
    const torch::Tensor weight = flat.numbers.narrow(0, at, in * out).view({out, in});
    layers.push_back({weight, flat.numbers.narrow(0, at + in * out, out)});
    at += (in + 1) * out;
  }
  return layers;
}

FlatLayers flatten(const std::vector<LinearLayer>& layers) {
  if (layers.empty()) throw Error("flatten: expected at least one layer");
  for (const LinearLayer& layer : layers) {
    if (!layer.weight.defined() || layer.weight.dim() != 2 || !layer.bias.defined())
      throw Error("flatten: expected weights [out, in] and biases [out], found " +
                  shape_of(layer.weight) + " and " + shape_of(layer.bias));
  }
  variable_list tensors;
  std::vector<std::int64_t> widths{layers.front().weight.size(1)};
  for (const LinearLayer& layer : layers) {
    tensors.push_back(layer.weight.reshape({-1}));
    tensors.push_back(layer.bias);
    widths.push_back(layer.weight.size(0));
  }
  return {torch::cat(tensors), widths};
}

torch::Tensor mlp(const torch::Tensor& x, const std::vector<LinearLayer>& layers,
                  kernels::Activation activation) {
  if (PlainTensors::asked_for()) return mlp_reference(x, layers, activation);
  check(x, layers);
  return apply(x.unsqueeze(0), torch::empty({1, 0}, x.options()), flatten(layers), activation)
      .squeeze(0);
}

torch::Tensor mlp(const torch::Tensor& features, const torch::Tensor& z, const FlatLayers& layers,
                  kernels::Activation activation) {
  check(features, z, layers);
  const std::int64_t n = features.size(0), m = features.size(1), out = layers.widths.back();
  // A tile belongs to one code: with few samples each, most of it would be empty.
  if (!PlainTensors::asked_for() && m >= kTile / 2) return apply(features, z, layers, activation);
  const torch::Tensor x = beside(features, z).flatten(0, 1);
  const torch::Tensor y =
      PlainTensors::asked_for()
          ? mlp_reference(x, layers_of(layers), activation)
          : apply(x.unsqueeze(0), torch::empty({1, 0}, x.options()), layers, activation);
  return y.view({n, m, out});
}

torch::Tensor mlp(const torch::Tensor& features, const torch::Tensor& z,
                  const std::vector<LinearLayer>& layers, kernels::Activation activation) {
  check(features, z, layers);
  return mlp(features, z, flatten(layers), activation);
}

torch::Tensor mlp_reference(const torch::Tensor& x, const std::vector<LinearLayer>& layers,
                            kernels::Activation activation) {
  check(x, layers);
  torch::Tensor y = x;
  for (std::size_t k = 0; k < layers.size(); ++k) {
    y = torch::linear(y, layers[k].weight, layers[k].bias);
    if (k + 1 < layers.size()) y = activate(y, activation);
  }
  return y;
}

}  // namespace uniphy::ops
