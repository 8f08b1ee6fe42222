#include "uniphy/inference/initial_state.hpp"

namespace uniphy {
namespace {

constexpr int kRigid = 6, kSymmetric = 6;  // numbers

}  // namespace

int monomial_count(int degree) { return (degree + 1) * (degree + 2) * (degree + 3) / 6; }

int velocity_numbers(int degree) {
  if (degree == 0) return kRigid;
  return kRigid + kSymmetric + 3 * (monomial_count(degree) - monomial_count(1));
}

int initial_numbers(int degree) {
  return velocity_numbers(degree) + (degree == 0 ? 0 : kSymmetric * monomial_count(degree));
}

}  // namespace uniphy
