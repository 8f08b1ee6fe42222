#pragma once

#include <cstdint>

namespace uniphy {

/// The finaliser of splitmix64: neighbouring numbers become unrelated ones.
/// S. Vigna, splitmix64 (public domain), constants by D. Stafford.
constexpr std::uint64_t scramble(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// What a stream of random numbers is for. Streams do not share numbers, so one more draw in one of
/// them leaves the others as they were. The values are part of what a seed means: never renumber.
enum class Stream : std::uint64_t {
  strata = 1,  ///< how the ranges of a material are cut between the trajectories
  material = 2,
  body = 3,  ///< shape, size, rotation
  motion = 4,
  sampling = 5,      ///< which samples are kept, which states are drawn
  random_solid = 6,  ///< laws drawn at random, by kind
  random_fluid = 7,
  random_plastic = 8
};

/// The seed of one stream of one trajectory.
constexpr std::uint64_t stream_seed(std::uint64_t seed, Stream stream, std::uint64_t trajectory,
                                    std::uint64_t attempt) {
  std::uint64_t s = scramble(seed);
  for (const std::uint64_t part : {static_cast<std::uint64_t>(stream), trajectory, attempt}) {
    s = scramble(s ^ part);
  }
  return s;
}

}  // namespace uniphy
