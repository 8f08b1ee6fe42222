#pragma once

#include <map>
#include <string>
#include <vector>

#include "ops/kernels/simd/isa.hpp"

namespace uniphy::testing {

/// One row of the gradient table: relative errors of a hand-written adjoint against central
/// differences in float64.
struct GradientRow {
  std::string op, input;
  std::map<std::string, double> errors;  ///< by column; ops without columns have one, ""
};

/// The groups of deformation_cases and the two sides of the yield surfaces, in their order.
std::vector<std::string> deformation_columns();

/// SVD and the laws, by the kernels of one instruction set: a column a group of deformations.
std::vector<GradientRow> law_rows(kernels::Isa isa);
/// The learned law's op in both forms, with the same columns. Like all ops below it runs on
/// kernels::active_isa().
std::vector<GradientRow> learned_law_rows();
/// P2G, grid update, G2P, the network, the errors that training minimises, and roll-outs of 50
/// steps: one number a row.
std::vector<GradientRow> op_rows();

}  // namespace uniphy::testing
