#include "ops/kernels/mpm/mpm_table.hpp"

#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {

#define UNIPHY_DECLARE_MPM_TABLES(isa)            \
  namespace isa {                                 \
  extern const MpmTable<float> mpm_table_float;   \
  extern const MpmTable<double> mpm_table_double; \
  }

UNIPHY_DECLARE_MPM_TABLES(isa_baseline)
#if defined(UNIPHY_HAVE_X86_ISA)
UNIPHY_DECLARE_MPM_TABLES(isa_avx2)
UNIPHY_DECLARE_MPM_TABLES(isa_avx512)
#endif

namespace {

void require(Isa isa) {
  if (!isa_available(isa)) {
    throw Error(std::string("instruction set ") + isa_name(isa) + " is not available here");
  }
}

}  // namespace

template <>
const MpmTable<float>& mpm_table<float>(Isa isa) {
  require(isa);
#if defined(UNIPHY_HAVE_X86_ISA)
  if (isa == Isa::avx512) return isa_avx512::mpm_table_float;
  if (isa == Isa::avx2) return isa_avx2::mpm_table_float;
#endif
  return isa_baseline::mpm_table_float;
}

template <>
const MpmTable<double>& mpm_table<double>(Isa isa) {
  require(isa);
#if defined(UNIPHY_HAVE_X86_ISA)
  if (isa == Isa::avx512) return isa_avx512::mpm_table_double;
  if (isa == Isa::avx2) return isa_avx2::mpm_table_double;
#endif
  return isa_baseline::mpm_table_double;
}

}  // namespace uniphy::kernels
