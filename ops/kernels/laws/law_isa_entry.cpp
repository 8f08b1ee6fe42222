// Compiled once for each instruction set. Nothing here may be a symbol that another translation
// unit can define as well: all code sits in the inline namespace of the instruction set.

#include "ops/kernels/laws/carreau.hpp"
#include "ops/kernels/laws/direct_law.hpp"
#include "ops/kernels/laws/drucker_prager.hpp"
#include "ops/kernels/laws/fixed_corotated.hpp"
#include "ops/kernels/laws/herschel_bulkley.hpp"
#include "ops/kernels/laws/law_batch.hpp"
#include "ops/kernels/laws/mooney_rivlin.hpp"
#include "ops/kernels/laws/neo_hookean.hpp"
#include "ops/kernels/laws/newtonian.hpp"
#include "ops/kernels/laws/plastic_law.hpp"
#include "ops/kernels/laws/viscoplastic.hpp"
#include "ops/kernels/laws/von_mises.hpp"
#include "ops/kernels/laws/water.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace {

template <class T>
constexpr LawTable<T> kTable{
    svd3_batch<T>,
    svd3_adjoint_batch<T>,
    // In the order of LawId.
    {law_entries<DirectLaw<IdentityProjection, NeoHookean>, T>(),
     law_entries<DirectLaw<VolumetricProjection, Newtonian>, T>(),
     law_entries<PlasticLaw<VonMises>, T>(), law_entries<PlasticLaw<DruckerPrager>, T>(),
     law_entries<PlasticLaw<Viscoplastic>, T>(),
     law_entries<DirectLaw<IdentityProjection, FixedCorotated>, T>(),
     law_entries<DirectLaw<VolumetricProjection, Water>, T>(),
     law_entries<PlasticLaw<DruckerPrager, VolumeMemory>, T>(),
     law_entries<DirectLaw<IdentityProjection, MooneyRivlin>, T>(),
     law_entries<DirectLaw<VolumetricProjection, Carreau>, T>(),
     law_entries<PlasticLaw<CohesiveDruckerPrager>, T>(),
     law_entries<PlasticLaw<HerschelBulkley>, T>()}};

}  // namespace

UNIPHY_DEFINE_ISA_TABLES(LawTable, kTable)

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
