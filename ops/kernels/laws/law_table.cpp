#include "ops/kernels/laws/law_table.hpp"

#include <string>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/law.hpp"

namespace uniphy::kernels {

static_assert(static_cast<int>(LawId::learned) == kAnalyticLaws);

#define UNIPHY_DECLARE_LAW_TABLES(isa)            \
  namespace isa {                                 \
  extern const LawTable<float> law_table_float;   \
  extern const LawTable<double> law_table_double; \
  }

UNIPHY_DECLARE_LAW_TABLES(isa_baseline)
#if defined(UNIPHY_HAVE_X86_ISA)
UNIPHY_DECLARE_LAW_TABLES(isa_avx2)
UNIPHY_DECLARE_LAW_TABLES(isa_avx512)
#endif

namespace {

void require(Isa isa) {
  if (!isa_available(isa)) {
    throw Error(std::string("instruction set ") + isa_name(isa) + " is not available here");
  }
}

}  // namespace

template <>
const LawTable<float>& law_table<float>(Isa isa) {
  require(isa);
#if defined(UNIPHY_HAVE_X86_ISA)
  if (isa == Isa::avx512) return isa_avx512::law_table_float;
  if (isa == Isa::avx2) return isa_avx2::law_table_float;
#endif
  return isa_baseline::law_table_float;
}

template <>
const LawTable<double>& law_table<double>(Isa isa) {
  require(isa);
#if defined(UNIPHY_HAVE_X86_ISA)
  if (isa == Isa::avx512) return isa_avx512::law_table_double;
  if (isa == Isa::avx2) return isa_avx2::law_table_double;
#endif
  return isa_baseline::law_table_double;
}

}  // namespace uniphy::kernels
