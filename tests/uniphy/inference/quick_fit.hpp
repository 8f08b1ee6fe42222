#pragma once

#include "uniphy/inference/infer_run.hpp"

namespace uniphy::testing {

/// The elastic law of a small body, fitted by a short schedule without samples of the posterior.
inline Inference quick_elastic_fit(const Observation& seen) {
  const auto variables =
      make_analytic_variables(kernels::LawId::elastic, {{5e3, 5e5}, {5e3, 5e5}}, 12, 1);
  FitOptions options;
  options.stages = {{0.3, 4, 5}, {1, 2, 12}};
  FitHooks quiet;
  quiet.progress = false;
  AdaptationOptions adaptation;
  adaptation.samples = 0;
  return infer(seen, "o", *variables, options, quiet, adaptation);
}

}  // namespace uniphy::testing
