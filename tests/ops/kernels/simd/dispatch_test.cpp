// The tables of the instruction sets: one each, the active one by default.

#include "ops/kernels/simd/dispatch.hpp"

#include <gtest/gtest.h>

#include <set>

#include "ops/kernels/laws/law_table.hpp"
#include "ops/kernels/learned/learned_law_table.hpp"
#include "ops/kernels/loss/law_losses_table.hpp"
#include "ops/kernels/mpm/mpm_table.hpp"

namespace uniphy::kernels {
namespace {

template <class Table>
class Dispatch : public ::testing::Test {};
using Tables = ::testing::Types<LawTable<float>, LawTable<double>, MpmTable<float>,
                                MpmTable<double>, LawLossesTable<float>, LawLossesTable<double>,
                                LearnedLawTable<float>, LearnedLawTable<double>>;
TYPED_TEST_SUITE(Dispatch, Tables);

TYPED_TEST(Dispatch, EveryInstructionSetHasATableOfItsOwn) {
  std::set<const TypeParam*> tables;
  for (const Isa isa : available_isas()) tables.insert(&table_of<TypeParam>(isa));
  EXPECT_EQ(tables.size(), available_isas().size());
  EXPECT_EQ(&table_of<TypeParam>(), &table_of<TypeParam>(active_isa()));
}

TEST(DispatchOfLaws, CodeIsCompiledForEachInstructionSet) {
  std::set<decltype(LawTable<float>::svd3)> functions;
  for (const Isa isa : available_isas()) functions.insert(law_table<float>(isa).svd3);
  EXPECT_EQ(functions.size(), available_isas().size());
}

}  // namespace
}  // namespace uniphy::kernels
