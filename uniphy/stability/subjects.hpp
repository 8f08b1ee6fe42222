#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/io/model_file.hpp"
#include "uniphy/stability/stability_options.hpp"

namespace uniphy::stability {

/// One material by the three kinds of law.
struct Subject {
  std::string material;
  kernels::LawDescription analytic;   ///< the parameters behind the code
  kernels::LawDescription isotropic;  ///< the trained law with the code
  kernels::LawDescription published;  ///< a random network with a random code of the same stiffness

  /// By the name of a method; the references to fail use the analytic law.
  const kernels::LawDescription& law(const std::string& method) const;
};

struct Subjects {
  ModelFile model;
  std::string fingerprint;         ///< a hash of the model's numbers
  std::vector<Subject> materials;  ///< a family each
};

/// Reads the model and takes of every family the code whose material is the nearest to the middle
/// of its ranges (material_ranges.hpp), in units of their width, logarithmic as they are drawn. The
/// published form is a network of 4 × 128 units, the authors' size, as training begins with it.
/// Throws Error naming the file, where the form is another or a family has no code.
Subjects load_subjects(const StabilityOptions& options);

}  // namespace uniphy::stability
