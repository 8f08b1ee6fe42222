#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace uniphy {

/// The equivalent plastic strain of particles since the first frame, for pictures.
///
///   Fₚ = Fₑ⁻¹ F Fₑ₀,   εₚ = √(2/3) ‖dev log √(FₚᵀFₚ)‖
///
/// Fₑ is the elastic deformation gradient that a simulation keeps (Fₑ₀: in the first frame). It
/// does not keep the whole F, which is taken from where the particles went: the affine map that
/// takes the neighbours of a particle in the first frame closest to where they are now. Of a fluid
/// this is how far it flowed. Smooth to the distance of neighbours; of a body that stays elastic it
/// is not zero but as small as what is not affine between neighbours.
class PlasticStrain {
 public:
  static constexpr int kNeighbours = 12;

  /// x [particles, 3] m, F [particles, 3, 3] and body [particles] of the first frame.
  PlasticStrain(const std::vector<double>& x, const std::vector<double>& F,
                const std::vector<std::int32_t>& body);
  /// [particles], of a later frame; NaN of a particle without neighbours in space around it.
  std::vector<float> at(const std::vector<double>& x, const std::vector<double>& F) const;

 private:
  void add_neighbours(const std::vector<double>& x, const std::vector<std::int32_t>& of_body);

  struct Particle {
    std::vector<std::int32_t> neighbours;
    Eigen::Matrix3d inverse;  ///< of the sum of d dᵀ, d from the particle to a neighbour
    Eigen::Matrix3d elastic;  ///< Fₑ₀
    bool whole = false;       ///< there are neighbours in all directions
  };
  std::vector<double> x_;
  std::vector<Particle> particles_;
};

}  // namespace uniphy
