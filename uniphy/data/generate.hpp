#pragma once

#include <filesystem>
#include <string>

#include "uniphy/data/generate_options.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/report/metrics.hpp"

namespace uniphy {

/// Draws, simulates and samples all trajectories and writes the data set (uniphy/io/dataset.hpp) to
/// `file`. Trajectories run side by side, one a thread; the file has the same bits whatever their
/// number. Finished ones are kept in `<file>.parts-<hash of config>`: a second call with the same
/// configuration after an interruption goes on there, and the result is the same. The parts are
/// removed when the file is whole.
///
/// Trajectories of laws drawn at random (random_law_samples.hpp) follow once those of the five
/// families are there; their record is that of the trajectory that gave the states, with a name of
/// kRandomLawKinds and no parameters.
///
/// A run that fails is left out, reported on stderr and replaced; where all `attempts` of a
/// trajectory fail, throws Error with the last reason.
///
/// Metrics: trajectories, samples, `failed.M` (runs left out), `simulated.M`, `drawn.M` (samples),
/// `yielding.M` (part of the trajectories that yield in the simulation, plastic materials),
/// `share.M.B` and `share_simulated.M.B` (part of the samples, of the simulated samples of material
/// M in branch B, see law_branches.hpp), `large_affine.M` (part with ‖C‖ > 10 /s), `strain_low.M`,
/// `strain_median.M`, `strain_high.M` (quantiles 0.01, 0.5, 0.99 of ‖ε‖), `dt_lowered`
/// (trajectories whose step is below simulation.dt). M may be random_solid, ... as
/// well, all of whose samples are drawn; branches of random_plastic: elastic, yield.
void generate_dataset(const GenerateOptions& options, const std::string& config_yaml,
                      const std::filesystem::path& file, Metrics& metrics);

/// `<file>.parts-<hash of config>`, see generate_dataset.
std::filesystem::path parts_directory(std::filesystem::path file, const std::string& config_yaml);

/// The data set of these options: read from `file` where that was drawn with exactly this
/// configuration, drawn into it (generate_dataset with generate_config(options)) otherwise.
/// Metrics, unless null, are set only where it is drawn. Throws Error where `file` is no data set.
Dataset drawn_dataset(const GenerateOptions& options, const std::filesystem::path& file,
                      Metrics* metrics = nullptr);

}  // namespace uniphy
