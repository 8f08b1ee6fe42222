// Prints the gradient table: op × case → relative error of the hand-written adjoint against central
// differences in float64, as Markdown. Usage: uniphy_gradient_table [baseline|avx2|avx512]
// The exit code is 1 where an entry is above 1e-6.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "ops/kernels/base/error.hpp"
#include "tests/ops/gradient_table/rows.hpp"

namespace uniphy::testing {
namespace {

constexpr double kTolerance = 1e-6;

void print_head(const std::vector<std::string>& columns) {
  std::printf("| op | with respect to |");
  for (const std::string& column : columns) std::printf(" %s |", column.c_str());
  std::printf("\n|---|---|");
  for (std::size_t i = 0; i < columns.size(); ++i) std::printf("---|");
  std::printf("\n");
}

/// Returns the largest entry.
double print_rows(const std::vector<GradientRow>& rows, const std::vector<std::string>& columns) {
  double largest = 0;
  for (const GradientRow& row : rows) {
    std::printf("| %s | %s |", row.op.c_str(), row.input.c_str());
    for (const std::string& column : columns) {
      const auto at = row.errors.find(column);
      if (at == row.errors.end()) {
        std::printf(" |");
        continue;
      }
      std::printf(" %.0e |", at->second);
      largest = std::max(largest, std::isnan(at->second) ? INFINITY : at->second);
    }
    std::printf("\n");
  }
  return largest;
}

/// Returns whether every entry is small enough.
bool print_table(kernels::Isa isa) {
  const std::vector<std::string> columns = deformation_columns();
  print_head(columns);
  const double laws = print_rows(law_rows(isa), columns);
  const double learned = print_rows(learned_law_rows(), columns);
  std::printf("\n");
  print_head({"relative error"});
  const double others = print_rows(op_rows(), {""});
  std::printf("\nLargest entry (%s): %.1e among the laws, %.1e of the learned law, %.1e below\n",
              kernels::isa_name(isa), laws, learned, others);
  return laws <= kTolerance && learned <= kTolerance && others <= kTolerance;
}

}  // namespace
}  // namespace uniphy::testing

int main(int argc, char** argv) {
  using namespace uniphy;
  try {
    // Before the first op asks for it: the ops take no instruction set of their own.
    if (argc > 1) setenv("UNIPHY_ISA", argv[1], 1);
    return testing::print_table(kernels::active_isa()) ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "uniphy_gradient_table: %s\n", error.what());
    return 1;
  }
}
