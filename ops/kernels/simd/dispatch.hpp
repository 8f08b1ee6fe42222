#pragma once

#include <string>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/simd/isa.hpp"

// How code is reached that is compiled once for each instruction set. Such a file, *_isa_entry.cpp,
// lists its functions in a table of function pointers and gives it to isa_table in the namespace of
// the instruction set that it is compiled for (UNIPHY_ISA of lanes.hpp). For tables MpmTable<T>:
//   UNIPHY_ISA_TABLE(MpmTable<float>) UNIPHY_ISA_TABLE(MpmTable<double>)   in their header,
//   UNIPHY_DEFINE_ISA_TABLES(MpmTable, kTable)                             in the entry file,
// where kTable<T> is the table. table_of chooses among them while the program runs.

namespace uniphy::kernels {

// Inline, as lanes.hpp makes the one that a file is compiled for.
inline namespace isa_baseline {
template <class Table>
const Table& isa_table();
}
#if defined(UNIPHY_HAVE_X86_ISA)
inline namespace isa_avx2 {
template <class Table>
const Table& isa_table();
}
inline namespace isa_avx512 {
template <class Table>
const Table& isa_table();
}
#endif

#define UNIPHY_ISA_TABLE_IN(isa, ...) \
  inline namespace isa {              \
  template <>                         \
  const __VA_ARGS__& isa_table();     \
  }
/// In namespace uniphy::kernels: there is a table of this type for each instruction set.
#if defined(UNIPHY_HAVE_X86_ISA)
#define UNIPHY_ISA_TABLE(...)                    \
  UNIPHY_ISA_TABLE_IN(isa_baseline, __VA_ARGS__) \
  UNIPHY_ISA_TABLE_IN(isa_avx2, __VA_ARGS__)     \
  UNIPHY_ISA_TABLE_IN(isa_avx512, __VA_ARGS__)
#else
#define UNIPHY_ISA_TABLE(...) UNIPHY_ISA_TABLE_IN(isa_baseline, __VA_ARGS__)
#endif

/// In namespace UNIPHY_ISA of an entry file: table<T> is the Table<T> of this instruction set.
#define UNIPHY_DEFINE_ISA_TABLES(Table, table) \
  template <>                                  \
  const Table<float>& isa_table() {            \
    return table<float>;                       \
  }                                            \
  template <>                                  \
  const Table<double>& isa_table() {           \
    return table<double>;                      \
  }

/// The table of an instruction set. Throws Error where this build or CPU lacks it.
template <class Table>
const Table& table_of(Isa isa = active_isa()) {
  if (!isa_available(isa))
    throw Error(std::string("instruction set ") + isa_name(isa) + " is not available here");
#if defined(UNIPHY_HAVE_X86_ISA)
  if (isa == Isa::avx512) return isa_avx512::isa_table<Table>();
  if (isa == Isa::avx2) return isa_avx2::isa_table<Table>();
#endif
  return isa_baseline::isa_table<Table>();
}

}  // namespace uniphy::kernels
