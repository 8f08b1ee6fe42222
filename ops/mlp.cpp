#include "ops/mlp.hpp"

#include <algorithm>
#include <memory>
#include <sstream>

#include "ops/kernels/aligned_buffer.hpp"
#include "ops/kernels/error.hpp"
#include "ops/kernels/learned_law_table.hpp"
#include "ops/plain_tensors.hpp"

namespace uniphy::ops {
namespace {

using kernels::kTile;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// Tiles are dealt to this many running sums, whatever the thread count, which are then added in
/// order: the same bits on one thread and on several.
constexpr std::int64_t kSums = 8;

std::string shape_of(const torch::Tensor& t) {
  std::ostringstream text;
  text << t.scalar_type() << " " << t.sizes();
  return text.str();
}

void check(const torch::Tensor& x, const std::vector<LinearLayer>& layers) {
  if (layers.empty()) throw Error("mlp: expected at least one layer");
  if (x.dim() != 2 || !torch::isFloatingType(x.scalar_type()))
    throw Error("mlp: x: expected a floating-point tensor [samples, features], found " +
                shape_of(x));
  std::int64_t in = x.size(1);
  for (std::size_t k = 0; k < layers.size(); ++k) {
    const torch::Tensor &w = layers[k].weight, &b = layers[k].bias;
    const bool fits = w.dim() == 2 && w.size(1) == in && b.dim() == 1 && b.size(0) == w.size(0) &&
                      w.scalar_type() == x.scalar_type() && b.scalar_type() == x.scalar_type();
    if (!fits)
      throw Error("mlp: layer " + std::to_string(k) + ": expected a weight [out, " +
                  std::to_string(in) + "] and a bias [out] of type " +
                  std::string(torch::toString(x.scalar_type())) + ", found " + shape_of(w) +
                  " and " + shape_of(b));
    in = w.size(0);
  }
}

/// The weights and biases of all layers one after the other in one tensor (autograd's Function
/// takes tensors, not lists of them), and the widths that cut it up.
template <class T>
std::unique_ptr<kernels::PackedMlpStorage<T>> pack(const torch::Tensor& flat,
                                                   const std::vector<std::int64_t>& widths,
                                                   kernels::Activation activation) {
  kernels::MlpWeights weights;
  const T* at = flat.data_ptr<T>();
  for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
    const std::int64_t in = widths[k], out = widths[k + 1];
    kernels::MlpWeights::Layer layer{int(in), int(out), {at, at + in * out}, {}};
    at += in * out;
    layer.bias.assign(at, at + out);
    at += out;
    weights.layers.push_back(std::move(layer));
  }
  return std::make_unique<kernels::PackedMlpStorage<T>>(weights, activation, std::vector<double>{});
}

/// Rows [first, first + kTile) of a row-major [samples, columns] as planes [columns, kTile];
/// missing rows are zero.
template <class T>
void to_planes(const T* rows, std::int64_t count, std::int64_t columns, T* planes) {
  for (std::int64_t c = 0; c < columns; ++c)
    for (std::int64_t l = 0; l < kTile; ++l)
      planes[c * kTile + l] = l < count ? rows[l * columns + c] : T(0);
}
template <class T>
void from_planes(const T* planes, std::int64_t count, std::int64_t columns, T* rows) {
  for (std::int64_t l = 0; l < count; ++l)
    for (std::int64_t c = 0; c < columns; ++c) rows[l * columns + c] = planes[c * kTile + l];
}

template <class T>
torch::Tensor forward(const torch::Tensor& x, const kernels::PackedMlp<T>& net) {
  const auto& table = kernels::learned_law_table<T>();
  const std::int64_t samples = x.size(0), tiles = (samples + kTile - 1) / kTile;
  torch::Tensor y = torch::empty({samples, net.out()}, x.options());
  const T* from = x.data_ptr<T>();
  T* to = y.data_ptr<T>();
  const std::int64_t plane = std::int64_t(net.max_width) * kTile;
#pragma omp parallel
  {
    kernels::AlignedBuffer<T> scratch(2 * plane + net.tape_scratch());
    T *in = scratch.data(), *out = in + plane, *tape = out + plane;
#pragma omp for schedule(static)
    for (std::int64_t t = 0; t < tiles; ++t) {
      const std::int64_t first = t * kTile, count = std::min<std::int64_t>(kTile, samples - first);
      to_planes(from + first * net.in(), count, net.in(), in);
      table.mlp_forward(net, in, out, tape);
      from_planes(out, count, net.out(), to + first * net.out());
    }
  }
  return y;
}

/// Gradients of x and of the flat weights, each where it is wanted.
template <class T>
variable_list backward(const torch::Tensor& x, const torch::Tensor& flat, const torch::Tensor& grad,
                       const kernels::PackedMlp<T>& net, bool want_x, bool want_weights) {
  const auto& table = kernels::learned_law_table<T>();
  const std::int64_t samples = x.size(0), tiles = (samples + kTile - 1) / kTile;
  const std::int64_t plane = std::int64_t(net.max_width) * kTile, lanes = table.lanes;
  torch::Tensor grad_x = want_x ? torch::empty_like(x) : torch::Tensor();
  const std::int64_t numbers_per_sum = flat.numel() * lanes;
  kernels::AlignedBuffer<T> sums(want_weights ? kSums * numbers_per_sum : 0);
  if (want_weights) std::fill_n(sums.data(), kSums * numbers_per_sum, T(0));
  const T *from = x.data_ptr<T>(), *grad_from = grad.data_ptr<T>();
  T* grad_to = want_x ? grad_x.data_ptr<T>() : nullptr;
#pragma omp parallel
  {
    kernels::AlignedBuffer<T> scratch(4 * plane + net.tape_scratch());
    T *in = scratch.data(), *out = in + plane, *grad_out = out + plane, *grad_in = grad_out + plane,
      *tape = grad_in + plane;
    std::vector<kernels::WeightGradient<T>> weights(net.depth);
#pragma omp for schedule(static)
    for (std::int64_t sum = 0; sum < kSums; ++sum) {
      T* at = sums.data() + (want_weights ? sum * numbers_per_sum : 0);
      for (int k = 0; want_weights && k < net.depth; ++k) {
        weights[k].weight = at;
        at += std::int64_t(net.layer[k].in) * net.layer[k].out * lanes;
        weights[k].bias = at;
        at += net.layer[k].out * lanes;
      }
      for (std::int64_t t = sum * tiles / kSums; t < (sum + 1) * tiles / kSums; ++t) {
        const std::int64_t first = t * kTile,
                           count = std::min<std::int64_t>(kTile, samples - first);
        to_planes(from + first * net.in(), count, net.in(), in);
        to_planes(grad_from + first * net.out(), count, net.out(), grad_out);
        table.mlp_forward(net, in, out, tape);
        table.mlp_backward(net, in, tape, grad_out, want_x ? grad_in : nullptr, nullptr,
                           want_weights ? weights.data() : nullptr);
        if (want_x) from_planes(grad_in, count, net.in(), grad_to + first * net.in());
      }
    }
  }
  if (!want_weights) return {grad_x, torch::Tensor()};
  torch::Tensor grad_flat = torch::empty_like(flat);
  T* to = grad_flat.data_ptr<T>();
  for (std::int64_t i = 0; i < flat.numel(); ++i) {
    T total = 0;
    for (std::int64_t sum = 0; sum < kSums; ++sum) {
      const T* part = sums.data() + sum * numbers_per_sum + i * lanes;
      for (std::int64_t l = 0; l < lanes; ++l) total += part[l];
    }
    to[i] = total;
  }
  return {grad_x, grad_flat};
}

struct MlpFunction : torch::autograd::Function<MlpFunction> {
  static torch::Tensor forward(AutogradContext* ctx, const torch::Tensor& x,
                               const torch::Tensor& flat, std::vector<std::int64_t> widths,
                               std::int64_t activation) {
    const torch::Tensor input = x.contiguous();
    ctx->save_for_backward({input, flat});
    ctx->saved_data["widths"] = widths;
    ctx->saved_data["activation"] = activation;
    const auto kind = static_cast<kernels::Activation>(activation);
    return x.scalar_type() == torch::kFloat64
               ? ops::forward<double>(input, pack<double>(flat, widths, kind)->mlp())
               : ops::forward<float>(input, pack<float>(flat, widths, kind)->mlp());
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    variable_list result(4);
    if (!grads[0].defined()) return result;
    const variable_list saved = ctx->get_saved_variables();
    const torch::Tensor &x = saved[0], &flat = saved[1], grad = grads[0].contiguous();
    const std::vector<std::int64_t> widths = ctx->saved_data["widths"].toIntVector();
    const auto kind = static_cast<kernels::Activation>(ctx->saved_data["activation"].toInt());
    const bool want_x = ctx->needs_input_grad(0), want_weights = ctx->needs_input_grad(1);
    const variable_list g =
        x.scalar_type() == torch::kFloat64
            ? ops::backward<double>(x, flat, grad, pack<double>(flat, widths, kind)->mlp(), want_x,
                                    want_weights)
            : ops::backward<float>(x, flat, grad, pack<float>(flat, widths, kind)->mlp(), want_x,
                                   want_weights);
    result[0] = g[0];
    result[1] = g[1];
    return result;
  }
};

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

torch::Tensor mlp(const torch::Tensor& x, const std::vector<LinearLayer>& layers,
                  kernels::Activation activation) {
  if (PlainTensors::asked_for()) return mlp_reference(x, layers, activation);
  check(x, layers);
  variable_list tensors;
  std::vector<std::int64_t> widths{x.size(1)};
  for (const LinearLayer& layer : layers) {
    tensors.push_back(layer.weight.reshape({-1}));
    tensors.push_back(layer.bias);
    widths.push_back(layer.weight.size(0));
  }
  return MlpFunction::apply(x, torch::cat(tensors), widths, static_cast<std::int64_t>(activation));
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
