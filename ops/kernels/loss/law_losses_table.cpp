#include "ops/kernels/loss/law_losses_table.hpp"

#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {

// Defined by law_losses_isa_entry.cpp, once for each instruction set.
inline namespace isa_baseline {
template <class T>
const LawLossesTable<T>& law_losses_isa_table();
}
#if defined(UNIPHY_HAVE_X86_ISA)
namespace isa_avx2 {
template <class T>
const LawLossesTable<T>& law_losses_isa_table();
}
namespace isa_avx512 {
template <class T>
const LawLossesTable<T>& law_losses_isa_table();
}
#endif

template <class T>
const LawLossesTable<T>& law_losses_table(Isa isa) {
  if (!isa_available(isa))
    throw Error(std::string("instruction set ") + isa_name(isa) + " is not available here");
#if defined(UNIPHY_HAVE_X86_ISA)
  if (isa == Isa::avx512) return isa_avx512::law_losses_isa_table<T>();
  if (isa == Isa::avx2) return isa_avx2::law_losses_isa_table<T>();
#endif
  return isa_baseline::law_losses_isa_table<T>();
}
template const LawLossesTable<float>& law_losses_table<float>(Isa);
template const LawLossesTable<double>& law_losses_table<double>(Isa);

}  // namespace uniphy::kernels
