#include "ops/library/library.hpp"

TORCH_LIBRARY(uniphy, library) {
  uniphy::ops::define_laws(library);
  uniphy::ops::define_learned_law(library);
  uniphy::ops::define_mpm(library);
  uniphy::ops::define_rollout(library);
}
