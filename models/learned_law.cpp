#include "models/learned_law.hpp"

#include <ATen/CPUGeneratorImpl.h>
#include <torch/torch.h>

#include <cmath>
#include <sstream>
#include <string>

#include "ops/kernels/base/error.hpp"
#include "ops/mlp/mlp.hpp"

namespace uniphy::models {

using ops::reference::LearnedLawTensors;
using ops::reference::MlpTensors;
using torch::Tensor;

namespace {

Tensor fused_mlp(const MlpTensors& net, kernels::Activation activation, const Tensor& features,
                 const Tensor& z) {
  std::vector<ops::LinearLayer> layers;
  for (std::size_t k = 0; k < net.weight.size(); ++k)
    layers.push_back({net.weight[k], net.bias[k]});
  const Tensor x = torch::cat({features, z.expand({features.size(0), z.size(-1)})}, 1);
  return ops::mlp(x, layers, activation);
}

MlpTensors random_network(std::int64_t in, const std::vector<std::int64_t>& hidden,
                          std::int64_t out, torch::Generator& generator) {
  MlpTensors net;
  const std::size_t depth = hidden.size() + 1;
  for (std::size_t k = 0; k < depth; ++k) {
    const bool last = k + 1 == depth;
    const std::int64_t rows = last ? out : hidden[k];
    const double deviation = (last ? 0.1 : 1.0) * std::sqrt(2.0 / double(in));
    net.weight.push_back(
        torch::empty({rows, in}, torch::kFloat64).normal_(0, deviation, generator));
    net.bias.push_back(torch::zeros({rows}, torch::kFloat64));
    in = rows;
  }
  return net;
}

void check_sizes(const LearnedLawOptions& options) {
  const auto refuse = [](const std::string& what, std::int64_t found) {
    throw Error("learned law: " + what + ", found " + std::to_string(found));
  };
  if (options.latent_size < 0)
    refuse("latent_size: expected 0 or more numbers", options.latent_size);
  for (const auto* hidden : {&options.projection_hidden, &options.stress_hidden})
    for (const std::int64_t width : *hidden)
      if (width < 1) refuse("a hidden layer: expected 1 or more units", width);
  if (options.dtype != torch::kFloat32 && options.dtype != torch::kFloat64)
    throw Error(std::string("learned law: dtype: expected Float or Double, found ") +
                c10::toString(options.dtype));
}

std::string describe(const Tensor& t) {
  std::ostringstream s;
  if (t.defined())
    s << t.sizes() << " " << t.scalar_type();
  else
    s << "an undefined tensor";
  return s.str();
}

}  // namespace

LearnedLawImpl::LearnedLawImpl(const LearnedLawOptions& options)
    : latent_size_(options.latent_size) {
  check_sizes(options);
  torch::Generator generator = at::make_generator<at::CPUGeneratorImpl>(options.seed);
  const auto shape = kernels::network_shape(options.form);
  LearnedLawTensors law;
  law.form = options.form;
  law.activation = options.activation;
  law.projection = random_network(shape.projection_in + latent_size_, options.projection_hidden,
                                  shape.projection_out, generator);
  law.stress = random_network(shape.stress_in + latent_size_, options.stress_hidden,
                              shape.stress_out, generator);
  if (options.form == kernels::LawForm::isotropic) {
    law.projection.bias.back().fill_(3);
    law.projection.bias.back()[2].fill_(0);  // the slope of the cap
  }
  for (MlpTensors* net : {&law.projection, &law.stress})
    for (auto* tensors : {&net->weight, &net->bias})
      for (Tensor& t : *tensors) t = t.to(options.dtype);
  adopt(law);
}

LearnedLawImpl::LearnedLawImpl(const kernels::LearnedLawWeights& weights, torch::Dtype dtype)
    : latent_size_(weights.latent_size) {
  weights.check();
  adopt(ops::reference::to_tensors(weights, dtype));
}

void LearnedLawImpl::adopt(const LearnedLawTensors& initial) {
  tensors_ = initial;
  tensors_.mlp = &fused_mlp;
  const auto adopt_network = [this](const char* name, MlpTensors& net) {
    for (std::size_t k = 0; k < net.weight.size(); ++k) {
      const std::string suffix = "_" + std::to_string(k);
      net.weight[k] =
          register_parameter(std::string(name) + "_weight" + suffix, net.weight[k].clone());
      net.bias[k] = register_parameter(std::string(name) + "_bias" + suffix, net.bias[k].clone());
    }
  };
  adopt_network("projection", tensors_.projection);
  adopt_network("stress", tensors_.stress);
}

kernels::LearnedLawWeights LearnedLawImpl::weights() const {
  const auto numbers = [](const Tensor& t) {
    const Tensor flat = t.detach().to(torch::kFloat64).contiguous();
    return std::vector<double>(flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel());
  };
  const auto network = [&numbers](const MlpTensors& net) {
    kernels::MlpWeights r;
    for (std::size_t k = 0; k < net.weight.size(); ++k)
      r.layers.push_back({int(net.weight[k].size(1)), int(net.weight[k].size(0)),
                          numbers(net.weight[k]), numbers(net.bias[k])});
    return r;
  };
  kernels::LearnedLawWeights w;
  w.form = tensors_.form;
  w.latent_size = int(latent_size_);
  w.activation = tensors_.activation;
  w.projection = network(tensors_.projection);
  w.stress = network(tensors_.stress);
  return w;
}

void LearnedLawImpl::check(const char* name, const Tensor& F, const Tensor& z) const {
  const auto dtype = tensors_.projection.weight[0].scalar_type();
  if (!F.defined() || F.dim() != 3 || F.size(1) != 3 || F.size(2) != 3 || F.scalar_type() != dtype)
    throw Error(std::string("learned law: ") + name + ": expected [P, 3, 3] " +
                c10::toString(dtype) + ", found " + describe(F));
  const bool shaped = z.defined() && (z.dim() == 1 || (z.dim() == 2 && z.size(0) == F.size(0))) &&
                      z.size(-1) == latent_size_ && z.scalar_type() == dtype;
  if (!shaped) {
    const std::string size = std::to_string(latent_size_);
    throw Error("learned law: z: expected [" + size + "] or [" + std::to_string(F.size(0)) + ", " +
                size + "] " + c10::toString(dtype) + ", found " + describe(z));
  }
}

Tensor LearnedLawImpl::project(const Tensor& F, const Tensor& z) const {
  check("F", F, z);
  return ops::reference::learned_project(tensors_, F, z);
}

Tensor LearnedLawImpl::stress(const Tensor& F_proj, const Tensor& C, const Tensor& z) const {
  check("F_proj", F_proj, z);
  check("C", C, z);
  if (C.size(0) != F_proj.size(0))
    throw Error("learned law: C: expected " + describe(F_proj) + ", found " + describe(C));
  return ops::reference::learned_stress(tensors_, F_proj, C, z);
}

std::int64_t LearnedLawImpl::parameter_count() const {
  std::int64_t count = 0;
  for (const Tensor& p : parameters()) count += p.numel();
  return count;
}

}  // namespace uniphy::models
