#include "uniphy/data/random_row.hpp"

#include "uniphy/data/random_streams.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy {
namespace {

bool gives_states(kernels::LawId family, RandomLawKind kind) {
  switch (family) {
    case kernels::LawId::elastic:
      return kind == RandomLawKind::solid;
    case kernels::LawId::newtonian:
      return kind == RandomLawKind::fluid;
    default:
      return kind == RandomLawKind::plastic;
  }
}

Stream stream_of(RandomLawKind kind) {
  switch (kind) {
    case RandomLawKind::solid:
      return Stream::random_solid;
    case RandomLawKind::fluid:
      return Stream::random_fluid;
    case RandomLawKind::plastic:
      break;
  }
  return Stream::random_plastic;
}

}  // namespace

std::vector<std::int64_t> bases_of(const GenerateOptions& options, RandomLawKind kind) {
  std::vector<std::int64_t> bases;
  for (std::int64_t i = 0; i < options.simulated(); ++i) {
    if (gives_states(options.material_of(i).id, kind)) bases.push_back(i);
  }
  return bases;
}

RandomRow random_row(const GenerateOptions& options, std::int64_t trajectory) {
  std::int64_t index = trajectory - options.simulated();
  std::size_t kind = 0;
  while (index >= options.random_laws[kind]) index -= options.random_laws[kind++];
  RandomRow row;
  row.kind = kRandomLawKinds[kind];
  const auto seed_of = [&](std::uint64_t purpose) {
    return stream_seed(scramble(options.seed) ^ static_cast<std::uint64_t>(options.split),
                       stream_of(row.kind), static_cast<std::uint64_t>(index), purpose);
  };
  row.seed = seed_of(0);
  const std::vector<std::int64_t> bases = bases_of(options, row.kind);
  row.base = bases[UniformRandom(seed_of(1)).below(bases.size())];
  return row;
}

}  // namespace uniphy
