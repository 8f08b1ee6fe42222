#pragma once

#include <filesystem>

#include "uniphy/training/heldout_curve.hpp"
#include "uniphy/training/trainer.hpp"

namespace uniphy {

/// The state of an interrupted training: networks, codes, AdamW's moments, curves, the codes of the
/// held-out curve with their moments (where there is one) and step, as a torch archive that is
/// written beside and renamed. It carries a fingerprint of the options and the data, so that it is
/// never continued with others.
class TrainingCheckpoint {
 public:
  TrainingCheckpoint(std::filesystem::path file, const Dataset& data,
                     const TrainingOptions& options, TrainingResult& state,
                     torch::optim::AdamW& optimizer, HeldoutCurve* heldout = nullptr);
  /// Fills the state from the file; returns the step to resume from, 0 where there is no file.
  std::int64_t load();
  void save(std::int64_t step) const;

 private:
  std::filesystem::path file_;
  std::string fingerprint_;
  TrainingResult& state_;
  torch::optim::AdamW& optimizer_;
  HeldoutCurve* heldout_;
};

}  // namespace uniphy
