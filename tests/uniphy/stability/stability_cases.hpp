#pragma once

#include <filesystem>
#include <string>

#include "tests/support/on_threads.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/experiment.hpp"
#include "uniphy/stability/stability_cell.hpp"
#include "uniphy/stability/stability_scenes.hpp"
#include "uniphy/stability/stability_stage.hpp"

namespace uniphy::testing {

inline std::string shipped_model() {
  return std::string(UNIPHY_SOURCE_DIR) + "/models/pretrained/unified.h5";
}

inline kernels::LawDescription elastic_law(double mu = 1e5, double lambda = 2e5) {
  kernels::LawDescription law;
  law.mu = mu;
  law.lambda = lambda;
  return law;
}

inline kernels::LawDescription plasticine_law() {
  kernels::LawDescription law = elastic_law();
  law.id = kernels::LawId::plasticine;
  law.tau_y = 5e3;
  return law;
}

inline kernels::LawDescription sand_law() {
  kernels::LawDescription law = elastic_law();
  law.id = kernels::LawId::sand;
  law.theta = 0.3;
  return law;
}

inline kernels::LawDescription non_newtonian_law() {
  kernels::LawDescription law = plasticine_law();
  law.id = kernels::LawId::non_newtonian;
  law.eta = 10;
  return law;
}

/// A cell with a name and a verdict.
inline stability::Cell cell_of(const std::string& stressor, const std::string& method,
                               const std::string& setting, stability::Verdict verdict,
                               double error) {
  stability::Cell cell;
  cell.stressor = stressor;
  cell.method = method;
  cell.setting = setting;
  cell.verdict = verdict;
  cell.deciding = "gradient_error";
  cell.set("gradient_error", error);
  return cell;
}

}  // namespace uniphy::testing
