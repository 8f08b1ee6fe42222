#pragma once

// latent.h5: the material that explains an observation.
//
//   attributes  format = "uniphy-latent", version = 1, law = "learned" or the name of an analytic
//               law, model = path of the model file that z belongs to (learned only),
//               config = YAML of the fit, dt = time step of the observation (s), determined = 1, or
//               0 where the observation did not show the material; files without dt or determined
//               are older: not known, and 1; rung = "latent", "numbers" or "weights", how far the
//               law was adapted (model is then the adapted one), explained = 1, or 0 where the
//               fitted law does not explain the motion; files without them are older: latent, and 1
//   /z          [latent_size]  1  latent code (learned only)
//   /parameters [5]            mu, lambda (Pa; mu of newtonian Pa s), tau_y (Pa), theta (rad),
//                              eta (Pa s); NaN where the law has none (analytic laws only)
//   /velocity/{centre, linear, angular} [3]  m, m/s, rad/s: the observed body at the first frame
//   /history/{stage, candidate, epoch} [E] int32, /history/{horizon (s), mse (m^2)} [E]
//   /nearest/{code [K] int32, distance [K], material [K]}  the training codes nearest to z, in
//   units
//                              of the spread of the codes along each coordinate (learned only)

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"

namespace uniphy {

/// One evaluation of the fit.
struct FitRecord {
  std::int32_t stage = 0;      ///< 0 is the first
  std::int32_t candidate = 0;  ///< start that it belongs to
  std::int32_t epoch = 0;      ///< within the stage
  double horizon = 0;          ///< s, the part of the observation that was compared
  double mse = 0;              ///< m², infinite where the roll-out failed
};

struct NearestCode {
  std::int32_t code = 0;
  double distance = 0;
  std::string material;
};

struct LatentFile {
  std::string law = "learned";
  std::string model;                 ///< path of the model file
  std::vector<double> z;             ///< learned
  kernels::LawDescription analytic;  ///< any other law
  std::array<double, 3> centre{}, linear{}, angular{};
  std::vector<FitRecord> history;
  std::vector<NearestCode> nearest;
  std::string config;
  double dt = 0;                ///< s, of the observation and the roll-outs; 0: not known
  bool determined = true;       ///< false: any other material would have moved like it
  std::string rung = "latent";  ///< how far the law was adapted: latent, numbers or weights
  bool explained = true;        ///< false: the law misses the motion by more than the noise
};

void write_latent(const std::filesystem::path& file, const LatentFile& latent);
/// Throws Error naming the attribute or dataset that is missing or not as above.
LatentFile read_latent(const std::filesystem::path& file);

}  // namespace uniphy
