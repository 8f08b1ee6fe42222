#include "uniphy/scene/shape_config.hpp"

#include <array>
#include <cstdio>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/fill.hpp"
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
#include "uniphy/geometry/winding_number.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

// The keys of one shape, and the loader that they give.
using ShapeReader = ShapeLoader (*)(Section&);

double length(Section& s, const std::string& key, double fallback, const std::string& doc) {
  return s.real(key, fallback, at_least(0), "", doc);
}

Vector3d lengths(Section& s, const std::string& key, std::array<double, 3> fallback,
                 const std::string& doc) {
  const std::array<double, 3> value = s.vector3(key, fallback, positive(), "", doc);
  return {value[0], value[1], value[2]};
}

int count(Section& s, const std::string& key, int fallback, const std::string& doc) {
  return static_cast<int>(s.integer(key, fallback, between(1, 1000), "", doc));
}

// Shapes check their own parameters when they are made.
template <class Shape, class... Arguments>
ShapeLoader solid(Arguments... arguments) {
  return [=](BodyDescription* body) { body->solid = std::make_shared<const Shape>(arguments...); };
}

ShapeLoader read_box(Section& s) { return solid<Box>(lengths(s, "sides", {1, 1, 1}, "sides")); }

ShapeLoader read_rounded_box(Section& s) {
  const Vector3d sides = lengths(s, "sides", {1, 1, 1}, "outer sides");
  return solid<RoundedBox>(sides, length(s, "radius", 0.15, "radius of the edges"));
}

ShapeLoader read_sphere(Section& s) { return solid<Sphere>(length(s, "radius", 0.5, "radius")); }

ShapeLoader read_ellipsoid(Section& s) {
  return solid<Ellipsoid>(lengths(s, "radii", {0.5, 0.35, 0.25}, "half axes"));
}

ShapeLoader read_torus(Section& s) {
  const double major = length(s, "major", 0.35, "radius of the ring");
  return solid<Torus>(major, length(s, "minor", 0.15, "radius of the tube"));
}

ShapeLoader read_cylinder(Section& s) {
  const double radius = length(s, "radius", 0.35, "radius");
  return solid<Cylinder>(radius, length(s, "height", 1, "height, along y"));
}

ShapeLoader read_capped_cone(Section& s) {
  const double bottom = length(s, "bottom_radius", 0.4, "radius of the lower end");
  const double top = length(s, "top_radius", 0.15, "radius of the upper end");
  return solid<CappedCone>(bottom, top, length(s, "height", 1, "height, along y"));
}

ShapeLoader read_rounded_cone(Section& s) {
  const double bottom = length(s, "bottom_radius", 0.3, "radius of the lower ball");
  const double top = length(s, "top_radius", 0.15, "radius of the upper ball");
  return solid<RoundedCone>(bottom, top, length(s, "spacing", 0.55, "from centre to centre"));
}

ShapeLoader read_pyramid(Section& s) {
  const double base = length(s, "base", 1, "side of the square base");
  return solid<Pyramid>(base, length(s, "height", 0.8, "height, along y"));
}

ShapeLoader read_octahedron(Section& s) {
  return solid<Octahedron>(length(s, "radius", 0.5, "radius of the circumscribed sphere"));
}

ShapeLoader read_dodecahedron(Section& s) {
  return solid<Dodecahedron>(length(s, "radius", 0.5, "radius of the circumscribed sphere"));
}

ShapeLoader read_blobby(Section& s) {
  const int balls = count(s, "count", Blobby::kCount, "number of balls");
  const double radius = length(s, "radius", Blobby::kRadius, "largest radius of a ball");
  const double smoothing = length(s, "smoothing", Blobby::kSmoothing, "width of the fillets");
  const auto seed =
      static_cast<std::uint64_t>(s.integer("seed", 1, at_least(0), "", "draws the lump"));
  return solid<Blobby>(balls, radius, smoothing, seed);
}

ShapeLoader read_toy(Section& s) {
  return solid<Toy>(length(s, "fillet", 0.05, "width of the fillets, at most 0.2"));
}

ShapeLoader read_knurling(Section& s) {
  const double radius = length(s, "radius", 0.35, "outer radius");
  const double height = length(s, "height", 1, "height, along y");
  const double depth = length(s, "depth", 0.06, "depth of the grooves, less than radius/4");
  const int grooves = count(s, "grooves", 10, "grooves a turn in each direction");
  const double turns = s.real("turns", 0.6, any_number(), "", "turns of a groove over the height");
  return solid<Knurling>(radius, height, depth, grooves, turns);
}

ShapeLoader read_gear(Section& s) {
  const double tip = length(s, "tip_radius", 0.5, "radius of the tips");
  const double root = length(s, "root_radius", 0.38, "radius between the teeth");
  const double bore = length(s, "bore_radius", 0.14, "radius of the hole, 0: none");
  const double thickness = length(s, "thickness", 0.3, "thickness, along y");
  return solid<Gear>(tip, root, bore, thickness, count(s, "teeth", 10, "number of teeth"));
}

ShapeLoader read_pawn(Section& s) {
  return solid<Pawn>(length(s, "fillet", 0.06, "width of the fillets, at most 0.09"));
}

ShapeLoader read_mesh(Section& s) {
  const auto file = s.input_file("file", required, "Wavefront OBJ file");
  return [file](BodyDescription* body) {
    const ClosedSurface surface = close_surface(read_obj(file));
    for (const std::string& text : surface.warnings) {
      std::fprintf(stderr, "warning: %s\n", text.c_str());
    }
    body->solid = std::make_shared<const MeshSolid>(surface);
  };
}

ShapeLoader read_cloud(Section& s) {
  const auto file = s.input_file("file", required,
                                 "HDF5 with /x (and /volume), or text with three numbers a line");
  const std::int64_t frame =
      s.integer("frame", 0, at_least(0), "", "frame, where /x is a trajectory");
  const double volume = s.real("particle_volume", 0, at_least(0), "m^3",
                               "volume of each particle before scaling, where the file has none");
  const bool in_place = s.boolean(
      "in_place", false, "keep the positions of the file, in place of center, rotation and size");
  const bool undeformed = s.boolean(
      "undeformed", false,
      "with in_place: the positions of a trajectory are those of a body without strain or motion");
  return [=](BodyDescription* body) {
    body->cloud = std::make_shared<const ParticleCloud>(read_particles(file, frame));
    if (in_place && body->cloud->of_trajectory && !undeformed) {
      throw Error(
          file.string() +
          ": in_place: expected positions of a body at rest, found a trajectory, whose velocities "
          "and strains would be lost; scene.continue goes on from its last state, undeformed: true "
          "starts anew from its positions");
    }
    if (volume > 0 && !body->cloud->volume.empty()) {
      throw Error(file.string() + ": expected /volume or particle_volume, found both");
    }
    const ParticleCloud& cloud = *body->cloud;
    if (!cloud.failure.empty()) {
      std::fprintf(stderr, "warning: %s: is of a run that failed: %s\n", file.c_str(),
                   cloud.failure.c_str());
    }
    if (volume > 0 || !cloud.volume.empty()) {
      const std::string odd =
          odd_scale(cloud, volume > 0 ? std::vector<double>{volume} : cloud.volume);
      if (!odd.empty()) std::fprintf(stderr, "warning: %s: %s\n", file.c_str(), odd.c_str());
    }
    body->particle_volume = volume;
    body->in_place = in_place;
  };
}

}  // namespace

ShapeLoader read_shape(Section& shape) {
  struct Entry {
    const char* name;
    const char* doc;
    ShapeReader read;
  };
  static constexpr Entry kShapes[] = {
      {"box", "box", read_box},
      {"rounded_box", "box with rounded edges", read_rounded_box},
      {"sphere", "ball", read_sphere},
      {"ellipsoid", "ellipsoid", read_ellipsoid},
      {"torus", "ring round y", read_torus},
      {"cylinder", "cylinder along y", read_cylinder},
      {"capped_cone", "cone along y with flat ends", read_capped_cone},
      {"rounded_cone", "hull of two balls along y", read_rounded_cone},
      {"pyramid", "pyramid on a square base", read_pyramid},
      {"octahedron", "regular octahedron", read_octahedron},
      {"dodecahedron", "regular dodecahedron", read_dodecahedron},
      {"blobby", "lump of merged balls", read_blobby},
      {"toy", "toy bear", read_toy},
      {"knurling", "knurled cylinder along y", read_knurling},
      {"gear", "spur gear round y", read_gear},
      {"pawn", "chess pawn", read_pawn},
      {"mesh", "triangle mesh from a file", read_mesh},
      {"particles", "particles from a file, one by one", read_cloud},
  };
  ShapeLoader loader;
  std::vector<Variant> variants;
  for (const Entry& entry : kShapes) {
    variants.push_back(
        {entry.name, entry.doc, [&loader, read = entry.read](Section& s) { loader = read(s); }});
  }
  shape.variant("type", std::string("box"), variants,
                "the shape, in units of its own (scaled by size)");
  return loader;
}

Filling read_filling(Section& section) {
  Filling filling;
  section.variant(
      "type", std::string("lattice"),
      {{"lattice", "cubic lattice with about so many particles",
        [&](Section& s) {
          filling.kind = Filling::Kind::lattice;
          filling.count = s.integer("particles", 1000, between(1, double(kMaximumParticles)), "",
                                    "wanted number, met as nearly as a lattice allows");
        }},
       {"per_side", "cubic lattice with so many cells along the longest side",
        [&](Section& s) {
          filling.kind = Filling::Kind::per_side;
          filling.count = s.integer("count", 10, between(1, 1e5), "", "cells along that side");
        }},
       {"spacing", "cubic lattice with cells of this width",
        [&](Section& s) {
          filling.kind = Filling::Kind::spacing;
          filling.spacing = s.real("width", required, positive(), "m", "largest width of a cell");
        }},
       {"random", "uniformly random points",
        [&](Section& s) {
          filling.kind = Filling::Kind::random;
          filling.count = s.integer("particles", 1000, between(1, double(kMaximumParticles)), "",
                                    "number, met exactly");
          filling.seed =
              static_cast<std::uint64_t>(s.integer("seed", 1, at_least(0), "", "draws the points"));
        }}},
      "how the shape is filled");
  return filling;
}

}  // namespace uniphy
