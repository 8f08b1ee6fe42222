#include <torch/optim.h>
#include <torch/serialize.h>

#include <sstream>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/descent.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

torch::optim::LBFGSParamState* lbfgs_state(torch::optim::Optimizer& optimizer) {
  if (optimizer.state().empty()) return nullptr;
  return static_cast<torch::optim::LBFGSParamState*>(optimizer.state().begin()->second.get());
}

void save_optimizer(torch::optim::Optimizer& optimizer, bool lbfgs,
                    torch::serialize::OutputArchive& archive) {
  // Scratch of the two-loop recursion: undefined tensors, which archives do not take.
  if (auto* state = lbfgs ? lbfgs_state(optimizer) : nullptr) state->al().reset();
  optimizer.save(archive);
}

}  // namespace

std::string Descent::save() const {
  torch::serialize::OutputArchive archive, optimizer;
  archive.write("counts", torch::tensor({std::int64_t(evaluations_), std::int64_t(stalled_),
                                         std::int64_t(ended_), std::int64_t(known_.size())}));
  std::vector<double> numbers{best_loss_, reference_, damping_, mean_length_, scale_};
  if (!known_.empty()) numbers.push_back(known_[0].loss);
  archive.write("numbers", torch::tensor(numbers, torch::kFloat64));
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    const std::string k = std::to_string(i);
    archive.write("leaf_" + k, leaves_[i].detach());
    archive.write("best_" + k, best_[i]);
    if (known_.empty()) continue;
    archive.write("known_" + k, known_[0].leaves[i]);
    archive.write("gradient_" + k, known_[0].gradient[i]);
  }
  save_optimizer(*optimizer_, lbfgs(), optimizer);
  archive.write("optimizer", optimizer);
  std::ostringstream bytes;
  archive.save_to(bytes);
  return bytes.str();
}

void Descent::load(const std::string& bytes) {
  torch::NoGradGuard no_grad;
  try {
    torch::serialize::InputArchive archive, optimizer;
    std::istringstream stream(bytes);
    archive.load_from(stream);
    Tensor counts, numbers;
    archive.read("counts", counts);
    archive.read("numbers", numbers);
    const auto count = [&](int i) { return static_cast<int>(counts[i].item<std::int64_t>()); };
    const auto at = [&](int i) { return numbers[i].item<double>(); };
    evaluations_ = count(0);
    stalled_ = count(1);
    ended_ = count(2) != 0;
    known_.assign(count(3) != 0 ? 1 : 0, Point());
    best_loss_ = at(0);
    reference_ = at(1);
    damping_ = at(2);
    mean_length_ = at(3);
    scale_ = at(4);
    if (!known_.empty()) known_[0].loss = at(5);
    const auto restore = [&](const std::string& name, const Tensor& like) {
      Tensor value;
      archive.read(name, value);
      if (value.sizes() != like.sizes()) {
        throw Error("state of the optimizer: expected " + std::to_string(like.numel()) +
                    " numbers, found " + std::to_string(value.numel()));
      }
      return value;
    };
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      const std::string k = std::to_string(i);
      leaves_[i].copy_(restore("leaf_" + k, leaves_[i]));
      best_[i] = restore("best_" + k, leaves_[i]);
      if (known_.empty()) continue;
      known_[0].leaves.push_back(restore("known_" + k, leaves_[i]));
      known_[0].gradient.push_back(restore("gradient_" + k, leaves_[i]));
    }
    archive.read("optimizer", optimizer);
    optimizer_->load(optimizer);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {  // of Torch, with a trace of calls after the first line
    const std::string text = error.what();
    throw Error("state of the optimizer: " + text.substr(0, text.find('\n')));
  }
}

void Descent::inherit(const std::string& bytes) {
  if (!lbfgs()) return;
  std::vector<Tensor> like;
  for (const Tensor& leaf : leaves_) like.push_back(leaf.detach().clone());
  Descent earlier(options_, std::move(like));
  earlier.load(bytes);
  auto* state = lbfgs_state(*earlier.optimizer_);
  if (state == nullptr || state->old_dirs().empty()) return;
  state->t(0);  // the change of the gradient from the old loss to the new one is no curvature
  scale_ = earlier.scale_;
  torch::serialize::OutputArchive out;
  save_optimizer(*earlier.optimizer_, true, out);
  std::ostringstream written;
  out.save_to(written);
  torch::serialize::InputArchive in;
  std::istringstream stream(written.str());
  in.load_from(stream);
  optimizer_->load(in);
}

}  // namespace uniphy
