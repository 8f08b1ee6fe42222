#include "ops/kernels/mpm/particle_state.hpp"

#include <utility>

namespace uniphy::kernels {

template <class T>
ParticleState<T> ParticleState<T>::undeformed(std::vector<T> x, std::vector<T> v) {
  ParticleState state;
  state.C.assign(3 * x.size(), T(0));
  state.F.assign(3 * x.size(), T(0));
  for (std::size_t k = 0; k < state.F.size(); k += 9) {
    state.F[k] = state.F[k + 4] = state.F[k + 8] = 1;
  }
  state.x = std::move(x);
  state.v = std::move(v);
  return state;
}

template struct ParticleState<float>;
template struct ParticleState<double>;

}  // namespace uniphy::kernels
