#include "uniphy/geometry/shape_catalogue.hpp"

#include <functional>
#include <map>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/shapes/blobby.hpp"
#include "uniphy/geometry/shapes/box.hpp"
#include "uniphy/geometry/shapes/capped_cone.hpp"
#include "uniphy/geometry/shapes/cylinder.hpp"
#include "uniphy/geometry/shapes/dodecahedron.hpp"
#include "uniphy/geometry/shapes/ellipsoid.hpp"
#include "uniphy/geometry/shapes/gear.hpp"
#include "uniphy/geometry/shapes/knurling.hpp"
#include "uniphy/geometry/shapes/octahedron.hpp"
#include "uniphy/geometry/shapes/pawn.hpp"
#include "uniphy/geometry/shapes/pyramid.hpp"
#include "uniphy/geometry/shapes/rounded_box.hpp"
#include "uniphy/geometry/shapes/rounded_cone.hpp"
#include "uniphy/geometry/shapes/sphere.hpp"
#include "uniphy/geometry/shapes/torus.hpp"
#include "uniphy/geometry/shapes/toy.hpp"

namespace uniphy {
namespace {

using Maker = std::function<SolidPtr(std::uint64_t seed)>;

template <class Shape>
Maker plain() {
  return [](std::uint64_t) { return std::make_shared<const Shape>(); };
}

const std::map<std::string, Maker>& makers() {
  static const std::map<std::string, Maker> table{
      {"blobby",
       [](std::uint64_t seed) {
         return std::make_shared<const Blobby>(Blobby::kCount, Blobby::kRadius, Blobby::kSmoothing,
                                               seed);
       }},
      {"box", plain<Box>()},
      {"capped_cone", plain<CappedCone>()},
      {"cylinder", plain<Cylinder>()},
      {"dodecahedron", plain<Dodecahedron>()},
      {"ellipsoid", plain<Ellipsoid>()},
      {"gear", plain<Gear>()},
      {"knurling", plain<Knurling>()},
      {"octahedron", plain<Octahedron>()},
      {"pawn", plain<Pawn>()},
      {"pyramid", plain<Pyramid>()},
      {"rounded_box", plain<RoundedBox>()},
      {"rounded_cone", plain<RoundedCone>()},
      {"sphere", plain<Sphere>()},
      {"torus", plain<Torus>()},
      {"toy", plain<Toy>()},
  };
  return table;
}

}  // namespace

const std::vector<std::string>& shape_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto& entry : makers()) list.push_back(entry.first);
    return list;
  }();
  return names;
}

SolidPtr make_shape(const std::string& name, std::uint64_t seed) {
  const auto entry = makers().find(name);
  if (entry != makers().end()) return entry->second(seed);
  std::string known;
  for (const std::string& candidate : shape_names())
    known += (known.empty() ? "" : ", ") + candidate;
  throw Error("shape: expected one of " + known + "; found \"" + name + "\"");
}

}  // namespace uniphy
