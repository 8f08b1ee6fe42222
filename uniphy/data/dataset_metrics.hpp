#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/data/generate_options.hpp"
#include "uniphy/data/law_branches.hpp"
#include "uniphy/data/part_file.hpp"
#include "uniphy/data/random_law.hpp"
#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/report/metrics.hpp"

namespace uniphy {

/// Counts what a data set holds; the names are listed in generate.hpp.
class DatasetMetrics {
 public:
  explicit DatasetMetrics(const GenerateOptions& options);
  void add(const TrajectorySetup& setup, const TrajectoryPart& part);
  /// Of a law drawn at random.
  void add(RandomLawKind kind, const TrajectoryPart& part);
  void write(Metrics& metrics) const;

 private:
  struct Material {
    std::string name;
    std::vector<std::string> branches;
    std::int64_t trajectories = 0, failed = 0, yielding = 0, large_affine = 0;
    std::vector<std::int64_t> simulated, drawn;  ///< [branches]
    std::vector<double> strains;
  };
  static Material make(const std::string& name, const std::vector<std::string>& branches);
  Material& find(const std::string& name);
  void add(Material& material, const std::vector<SampleFeatures>& features,
           const TrajectoryPart& part);

  std::vector<Material> materials_;
  double dt_;
  std::int64_t dt_lowered_ = 0;
};

}  // namespace uniphy
