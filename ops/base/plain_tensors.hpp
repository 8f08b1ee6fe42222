#pragma once

namespace uniphy::ops {

/// While one of these lives, the ops of training (mlp.hpp, law_losses.hpp) run as plain
/// tensor operations on the thread that made it: a computation built on them can be compared with
/// the same one in plain LibTorch.
class PlainTensors {
 public:
  PlainTensors();
  ~PlainTensors();
  PlainTensors(const PlainTensors&) = delete;
  PlainTensors& operator=(const PlainTensors&) = delete;

  static bool asked_for();

 private:
  bool before_;
};

}  // namespace uniphy::ops
