#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"
#include "uniphy/config/config.hpp"
#include "uniphy/data/material_ranges.hpp"

namespace uniphy {

/// Which set is drawn. A seed gives three sets that share no material.
enum class Split {
  train,
  heldout_materials,  ///< new parameters; shapes and motions those of train
  heldout_all         ///< new parameters, motions, and shapes that train never uses
};

/// "train", "heldout_materials", "heldout_all".
const char* split_name(Split split);
/// Throws Error that lists the known names.
Split split_from_name(const std::string& name);

/// How a data set is drawn; the defaults are those of the keys (read_generate_options).
struct GenerateOptions {
  std::uint64_t seed = 1;
  Split split = Split::train;
  std::int64_t trajectories = 40;  ///< per material
  std::int64_t attempts = 20;      ///< draws for one trajectory before generation gives up
  std::vector<MaterialRanges> materials = default_material_ranges();

  // simulation
  kernels::GridSettings grid;  ///< grid.dt is set for each trajectory
  std::int64_t steps = 2000;
  std::optional<double> dt = 1.0 / 4800;  ///< s; none: from the stiffness
  std::int64_t particles = 500;           ///< about so many, see fill_lattice_nearest
  double density = 1000;                  ///< kg/m^3

  // body
  std::vector<std::string> shapes, heldout_shapes;
  std::array<double, 2> size{0.2, 0.32};  ///< largest side, m

  // motion
  std::vector<std::string> motions{"falling", "left", "right", "diagonal", "random"};
  std::array<double, 2> speed{0.3, 5};         ///< m/s
  std::array<double, 2> gap{0, 0.15};          ///< to the walls ahead, m
  std::array<double, 2> angular_speed{0, 10};  ///< rad/s
  std::array<double, 2> impact_over_yield{0.7, 6};

  // samples
  std::int64_t samples = 1000;  ///< per trajectory
  std::int64_t every = 10;      ///< steps between two looks at the particles
  double uniform_share = 0.25;
  double drawn_share = 0.25;
  double drawn_strain = 0.5;  ///< largest
  double drawn_step = 0.01;
  double drawn_beyond = 1.5;
  std::array<double, 2> drawn_affine{0.1, 100};  ///< 1/s

  /// Trajectories of laws drawn at random, in the order of kRandomLawKinds; they follow the others.
  std::array<std::int64_t, 3> random_laws{};

  /// Those of the five families, which are simulated.
  std::int64_t simulated() const {
    return trajectories * static_cast<std::int64_t>(materials.size());
  }
  std::int64_t total() const {
    return simulated() + random_laws[0] + random_laws[1] + random_laws[2];
  }
  /// The material of a simulated trajectory: all of one material stand together.
  const MaterialRanges& material_of(std::int64_t trajectory) const {
    return materials[static_cast<std::size_t>(trajectory / trajectories)];
  }
};

/// Declares and reads all keys of uniphy_generate.
GenerateOptions read_generate_options(Section& config);
/// The same without `seed`, `split` and `random_laws`, for work that draws several sets itself. The
/// default of the key `trajectories` is what `options` holds.
void read_draw_options(Section& config, GenerateOptions& options);
/// Declares and reads the section `random_laws`, whose states come from options.materials.
void read_random_laws(Section& config, GenerateOptions& options);

/// The configuration of uniphy_generate that draws with these options, every key resolved: it reads
/// back to the same options, and what generate_dataset writes with it is to the bit what the binary
/// writes.
std::string generate_config(const GenerateOptions& options);

}  // namespace uniphy
