#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "ops/kernels/laws/law_parameters.hpp"
#include "uniphy/config/config.hpp"
#include "uniphy/scene/law_origin.hpp"

namespace uniphy {

/// A law as a configuration names it. Files are opened by load(), not while keys are read.
struct LawSource {
  /// Where the latent code of a learned law comes from.
  enum class Latent {
    code,    ///< code `index` of the model's training codes
    values,  ///< `z` itself
    file     ///< `latent_file`, or the folder of uniphy_infer that holds latent.h5
  };

  kernels::LawDescription description;  ///< complete for the analytic laws
  std::filesystem::path model;          ///< learned; may be empty with Latent::file
  Latent latent = Latent::code;
  std::int64_t index = 0;
  std::vector<double> z;
  std::filesystem::path latent_file;

  /// The law with weights and latent code; `origin`, unless null, receives where it comes from.
  /// Throws Error naming the file, and the index or the length that does not fit.
  kernels::LawDescription load(LawOrigin* origin = nullptr) const;
};

/// The values that a parameter of an analytic law may take.
Range range_of(const kernels::LawParameter& parameter);

/// Declares and reads volume_correction, the option of sand that scenes have by default: the id of
/// the law with it, or without.
kernels::LawId read_sand(Section& law);

/// Declares and reads the keys of a law: `type` and, beside it, the parameters of that law.
LawSource read_law(Section& law);

/// The fitted law in `latent` (latent.h5, or the folder that holds it). Its model is `model`, or,
/// where that is empty, the one that the latent file names, looked for as written, beside the
/// latent file, and as model.h5 beside it. `origin`, unless null, receives what the file says of
/// the fit.
kernels::LawDescription load_fitted_law(const std::filesystem::path& latent,
                                        const std::filesystem::path& model = {},
                                        LawOrigin* origin = nullptr);

}  // namespace uniphy
