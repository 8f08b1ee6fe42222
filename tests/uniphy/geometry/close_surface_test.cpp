#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/geometry/fill.hpp"
#include "uniphy/geometry/polygon_mesh.hpp"
#include "uniphy/geometry/winding_number.hpp"

namespace uniphy {
namespace {

using ::testing::ElementsAre;
using testing::error_of;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// The six faces of a cube from `low` to `high` as an OBJ file goes on; `first` vertices stand
/// before it. `in`: looks inwards. `missing` faces from the end are left out.
std::string cube(double low, double high, int first = 0, bool in = false, int missing = 0) {
  std::string text;
  for (const auto& corner : {"000", "100", "110", "010", "001", "101", "111", "011"}) {
    text += "v";
    for (int k = 0; k < 3; ++k) text += " " + std::to_string(corner[k] == '1' ? high : low);
    text += "\n";
  }
  const int faces[6][4] = {{1, 4, 3, 2}, {5, 6, 7, 8}, {1, 2, 6, 5},
                           {2, 3, 7, 6}, {3, 4, 8, 7}, {4, 1, 5, 8}};
  for (int f = 0; f < 6 - missing; ++f) {
    text += "f";
    for (int k = 0; k < 4; ++k) text += " " + std::to_string(first + faces[f][in ? 3 - k : k]);
    text += "\n";
  }
  return text;
}

std::string moved(std::string text, double shift_x) {
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    std::string line = text.substr(at, end - at);
    double x, y, z;
    if (std::sscanf(line.c_str(), "v %lf %lf %lf", &x, &y, &z) == 3) {
      line = "v " + std::to_string(x + shift_x) + " " + std::to_string(y) + " " + std::to_string(z);
    }
    result += line + "\n";
    at = end + 1;
  }
  return result;
}

ClosedSurface closed(const std::string& text) { return close_surface(parse_obj(text, "m.obj")); }

/// Particles of a lattice over the bounds, times the volume of a cell.
double filled(const ClosedSurface& surface, int per_side) {
  const MeshSolid solid(surface);
  const Eigen::Vector3d sides = solid.bounds().sides();
  const double cell = sides.maxCoeff() / per_side;
  return static_cast<double>(fill_lattice(solid, per_side).size()) * cell * cell * cell;
}

TEST(CloseSurface, ACubeHasItsVolume) {
  const ClosedSurface surface = closed(cube(0, 1));
  EXPECT_NEAR(surface.volume, 1, 1e-12);
  EXPECT_THAT(surface.warnings, IsEmpty());
}

TEST(CloseSurface, OverlappingPartsCountOnce) {
  const ClosedSurface surface = closed(cube(0, 1) + moved(cube(0, 1, 8), 0.5));
  EXPECT_NEAR(surface.volume, 1.5, 1e-9);
  EXPECT_NEAR(filled(surface, 24), 1.5, 1e-9);
  EXPECT_THAT(surface.warnings, ElementsAre("m.obj: parts overlap and count once there: 1.5 of 2 "
                                            "cubic units"));
}

TEST(CloseSurface, OverlapOfCurvedParts) {
  // Two balls of radius 1 with centres 1 apart: each loses a cap of height ½, πh²(3 − h)/3.
  PolygonMesh mesh;
  for (int ball = 0; ball < 2; ++ball) {
    const int rings = 80, around = 120;
    const auto first = static_cast<std::int32_t>(mesh.vertices.size());
    const auto at = [&](int ring, int k) {
      return first + (ring == 0 ? 0 : ring == rings ? 1 : 2 + (ring - 1) * around + k % around);
    };
    mesh.vertices.emplace_back(ball, 1, 0);
    mesh.vertices.emplace_back(ball, -1, 0);
    for (int i = 1; i < rings; ++i) {
      for (int k = 0; k < around; ++k) {
        const double polar = M_PI * i / rings, round = 2 * M_PI * k / around;
        mesh.vertices.emplace_back(ball + std::sin(polar) * std::cos(round), std::cos(polar),
                                   -std::sin(polar) * std::sin(round));
      }
    }
    for (int i = 0; i < rings; ++i) {
      for (int k = 0; k < around; ++k) {
        if (i > 0) mesh.faces.push_back({at(i, k), at(i + 1, k), at(i, k + 1)});
        if (i < rings - 1) mesh.faces.push_back({at(i, k + 1), at(i + 1, k), at(i + 1, k + 1)});
      }
    }
  }
  const double share = 1 - 5.0 / 32;  // 2·(π·¼·2.5/3) of 2·(4π/3)
  const double one = close_surface(mesh).mesh.signed_volume();
  EXPECT_NEAR(close_surface(mesh).volume / one, share, 2e-4);
}

TEST(CloseSurface, PartsThatLookInwardsAreTurned) {
  const ClosedSurface surface = closed(cube(0, 1) + moved(cube(0, 0.8, 8, true), 1.5));
  EXPECT_NEAR(surface.volume, 1.512, 1e-9);
  EXPECT_NEAR(filled(surface, 46), 1.512, 0.05);
  EXPECT_THAT(surface.warnings,
              ElementsAre("m.obj:23: the part from here on looks inwards and was turned"));
  // A whole file that looks inwards is as good as one that looks outwards.
  EXPECT_NEAR(closed(cube(0, 1, 0, true)).volume, 1, 1e-12);
  EXPECT_THAT(closed(cube(0, 1, 0, true)).warnings, IsEmpty());
}

TEST(CloseSurface, CavitiesStay) {
  const ClosedSurface surface = closed(cube(0, 1) + cube(0.25, 0.75, 8, true));
  EXPECT_NEAR(surface.volume, 0.875, 1e-9);
  EXPECT_NEAR(filled(surface, 8), 0.875, 1e-9);
  EXPECT_THAT(surface.warnings, IsEmpty());
  EXPECT_NEAR(closed(cube(0, 1, 0, true) + cube(0.25, 0.75, 8)).volume, 0.875, 1e-9);
  // A body in a cavity is a body.
  const ClosedSurface island =
      closed(cube(0, 1) + cube(0.25, 0.75, 8, true) + cube(0.375, 0.625, 16));
  EXPECT_NEAR(island.volume, 0.875 + 0.015625, 1e-9);
  EXPECT_THAT(island.warnings, IsEmpty());
}

TEST(CloseSurface, APartWithinAnotherAddsNothing) {
  const ClosedSurface surface = closed(cube(0, 1) + cube(0.25, 0.75, 8));
  EXPECT_NEAR(surface.volume, 1, 1e-9);
  ASSERT_EQ(surface.warnings.size(), 2u);
  EXPECT_THAT(surface.warnings[0],
              HasSubstr("m.obj:23: the part from here on lies within another"));
}

TEST(CloseSurface, TurnsFacesThatDisagreeWithTheirNeighbours) {
  std::string text = cube(0, 1);
  text.replace(text.find("f 5 6 7 8"), 9, "f 8 7 6 5");
  const ClosedSurface surface = closed(text);
  EXPECT_NEAR(surface.volume, 1, 1e-12);
  EXPECT_NEAR(filled(surface, 8), 1, 1e-12);
  EXPECT_THAT(surface.warnings,
              ElementsAre("m.obj:10: 1 of 6 faces were turned to agree with their "
                          "neighbours (this is the first)"));
}

TEST(CloseSurface, RefusesMissingFaces) {
  for (const int missing : {1, 2, 3}) {
    EXPECT_THAT(error_of([&] { closed(cube(0, 1, 0, false, missing)); }),
                HasSubstr("is open: expected holes of at most 3 % of its surface"))
        << missing;
  }
}

TEST(CloseSurface, RefusesALooseFin) {
  const std::string fin = "v 1 1 1\nv 2 1 1\nv 2 2 1\nf 9 10 11\n";
  EXPECT_THAT(error_of([&] { closed(cube(0, 1) + fin); }),
              HasSubstr("m.obj:18: the part of 1 faces from here on encloses no volume"));
  // One on an edge of the body.
  EXPECT_THAT(error_of([&] { closed(cube(0, 1) + "v 2 1 1\nf 7 3 9\n"); }),
              HasSubstr("m.obj:16: the part of"));
}

TEST(CloseSurface, DoubledFacesCountOnce) {
  const ClosedSurface alike = closed(cube(0, 1) + cube(0, 1, 8));
  EXPECT_NEAR(alike.volume, 1, 1e-12);
  EXPECT_THAT(alike.warnings, ElementsAre(HasSubstr("m.obj:23: 6 faces repeat")));
  EXPECT_NEAR(closed(cube(0, 1) + cube(0, 1, 8, true)).volume, 1, 1e-12);
  EXPECT_NEAR(closed(cube(0, 1) + "f 4 3 2 1\n").volume, 1, 1e-12);
}

TEST(CloseSurface, TheWallBetweenTwoBodiesIsNoSurface) {
  const ClosedSurface surface = closed(cube(0, 1) + moved(cube(0, 1, 8), 1));
  EXPECT_NEAR(surface.volume, 2, 1e-12);
  EXPECT_NEAR(filled(surface, 16), 2, 1e-12);
}

TEST(CloseSurface, ACornerOnAnEdgeIsNoHole) {
  // The upper face in two halves, whose common corners stand on edges of the sides.
  std::string text = cube(0, 1);
  text.replace(text.find("f 5 6 7 8"), 9, "v 0.5 0 1\nv 0.5 1 1\nf 5 9 10 8\nf 9 6 7 10");
  const ClosedSurface surface = closed(text);
  EXPECT_NEAR(surface.volume, 1, 1e-12);
  EXPECT_THAT(surface.warnings, IsEmpty());
}

TEST(CloseSurface, PolygonsNeedNotBeConvex) {
  // An L of area 3 and height 1, with faces of six corners that start at different ones.
  const char* const text =
      "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n"
      "v 0 0 1\nv 2 0 1\nv 2 1 1\nv 1 1 1\nv 1 2 1\nv 0 2 1\n"
      "f 5 4 3 2 1 6\nf 9 10 11 12 7 8\n"
      "f 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12\n";
  const ClosedSurface surface = closed(text);
  EXPECT_NEAR(surface.volume, 3, 1e-12);
  EXPECT_NEAR(filled(surface, 8), 3, 1e-12);
  EXPECT_THAT(surface.warnings, IsEmpty());
}

TEST(CloseSurface, RefusesAOneSidedSurface) {
  // A Möbius strip of five quadrilaterals and a twist.
  std::string text;
  for (int k = 0; k < 5; ++k) {
    const double round = 2 * M_PI * k / 5, half = round / 2;
    for (const double s : {-0.3, 0.3}) {
      text += "v " + std::to_string((1 + s * std::cos(half)) * std::cos(round)) + " " +
              std::to_string(s * std::sin(half)) + " " +
              std::to_string((1 + s * std::cos(half)) * std::sin(round)) + "\n";
    }
  }
  text += "f 1 2 4 3\nf 3 4 6 5\nf 5 6 8 7\nf 7 8 10 9\nf 9 10 1 2\n";
  EXPECT_THAT(error_of([&] { closed(text); }), HasSubstr("cannot be oriented alike"));
}

TEST(CloseSurface, AFaceOfAHundredThousandCornersIsNoTrouble) {
  // A disc with a point above it.
  const int n = 100000;
  std::string text = "v 0 1 0\n", face = "f", sides;
  for (int k = 0; k < n; ++k) {
    const double round = 2 * M_PI * k / n;
    text += "v " + std::to_string(std::cos(round)) + " 0 " + std::to_string(std::sin(round)) + "\n";
    face += " " + std::to_string(k + 2);
    sides += "f 1 " + std::to_string((k + 1) % n + 2) + " " + std::to_string(k + 2) + "\n";
  }
  EXPECT_NEAR(closed(text + face + "\n" + sides).volume, M_PI / 3, 1e-5);
  std::string over_ten = cube(0, 1) + "f";
  for (int k = 0; k < n; ++k) over_ten += " " + std::to_string(k % 8 + 1);
  EXPECT_THAT(error_of([&] { closed(over_ten + "\n"); }),
              HasSubstr("m.obj:15: face: expected a polygon that passes each vertex once"));
}

}  // namespace
}  // namespace uniphy
