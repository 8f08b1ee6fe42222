#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/fill.hpp"
#include "uniphy/geometry/polygon_mesh.hpp"
#include "uniphy/geometry/random.hpp"
#include "uniphy/geometry/winding_number.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

const char* const kCube =
    "# a unit cube of quadrilaterals\n"
    "o cube\n"
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
    "vn 0 0 1\n"
    "f 1 4 3 2\nf 5//1 6//1 7//1 8//1\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

// Sphere of radius 1 from rings of triangles; without its first `open` rings at the pole.
PolygonMesh sphere_mesh(int rings, int around, int open = 0) {
  PolygonMesh mesh;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < (i == 0 || i == rings ? 1 : around); ++j) {
      const double polar = M_PI * i / rings, round = 2 * M_PI * j / around;
      mesh.vertices.emplace_back(std::sin(polar) * std::cos(round), std::cos(polar),
                                 -std::sin(polar) * std::sin(round));
    }
  }
  for (int i = open; i < rings; ++i) {
    for (int j = 0; j < around; ++j) {
      const auto at = [&](int ring, int k) {
        return ring == 0       ? 0
               : ring == rings ? 1 + (rings - 1) * around
                               : 1 + (ring - 1) * around + k;
      };
      const int next = (j + 1) % around;
      if (i > 0) mesh.faces.push_back({at(i, j), at(i + 1, j), at(i, next)});
      if (i < rings - 1) mesh.faces.push_back({at(i, next), at(i + 1, j), at(i + 1, next)});
    }
  }
  return mesh;
}

double volume(const std::string& text) {
  const ClosedSurface surface = close_surface(parse_obj(text, "mesh.obj"));
  EXPECT_TRUE(surface.warnings.empty()) << surface.warnings[0];
  return surface.volume;
}

TEST(Obj, ReadsQuadrilateralsAndNegativeIndices) {
  const PolygonMesh mesh = parse_obj(kCube, "cube.obj");
  EXPECT_EQ(mesh.vertices.size(), 8u);
  EXPECT_EQ(mesh.faces.size(), 6u);
  EXPECT_EQ(mesh.lines, (std::vector<std::int64_t>{12, 13, 14, 15, 16, 17}));
  EXPECT_NEAR(volume(kCube), 1, 1e-12);
  EXPECT_NEAR(volume("v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nv 0 0 1\r\nf -4 -2 -3\r\nf -4 -3 -1\r\n"
                     "f -4 -1 -2\r\nf -3 -2 -1\r\n"),
              1.0 / 6, 1e-12);
}

TEST(Obj, ReadsLinesThatGoOn) {
  std::string text = kCube;
  text.replace(text.find("f 1 4 3 2"), 9, "f 1 4 \\\n3 2");
  EXPECT_NEAR(volume(text), 1, 1e-12);
}

TEST(Obj, KeepsDoublePrecision) {
  std::string text = kCube;
  text.replace(text.find("v 1 1 1"), 7, "v 1 1 1.0000000001");
  EXPECT_EQ(parse_obj(text, "cube.obj").vertices[6][2], 1.0000000001);
}

TEST(Obj, DropsFacesOfLessThanThreeCorners) {
  EXPECT_EQ(parse_obj(std::string(kCube) + "f 1 1 2\nf 1 2 2\n", "cube.obj").faces.size(), 6u);
}

TEST(Obj, WeldsCornersThatEachFaceRepeats) {
  // As exporters write them: three vertices of its own for each face.
  EXPECT_NEAR(volume("v 0 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 0 1\nf 4 5 6\n"
                     "v 0 0 0\nv 0 0 1\nv 0 1 0\nf 7 8 9\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
                     "f 10 11 12\n"),
              1.0 / 6, 1e-12);
}

TEST(WindingNumber, OfACube) {
  const WindingNumber winding(close_surface(parse_obj(kCube, "cube.obj")).mesh);
  EXPECT_NEAR(winding({0.5, 0.5, 0.5}), 1, 1e-12);
  EXPECT_NEAR(winding({0.01, 0.99, 0.5}), 1, 1e-12);
  EXPECT_NEAR(winding({-0.01, 0.5, 0.5}), 0, 1e-12);
}

TEST(WindingNumber, TreeAgreesWithTheSum) {
  const TriangleMesh mesh = close_surface(sphere_mesh(40, 60)).mesh;
  const WindingNumber winding(mesh);
  UniformRandom random(1);
  for (int trial = 0; trial < 500; ++trial) {
    const Vector3d p = random.in_box(Vector3d::Constant(-1.5), Vector3d::Constant(1.5));
    const double exact = winding.exact(p);
    if (std::abs(p.norm() - 1) > 0.01) {
      ASSERT_NEAR(exact, p.norm() < 1 ? 1 : 0, 1e-9);
    }
    ASSERT_NEAR(winding(p), exact, 0.03) << p.transpose();
  }
}

TEST(MeshSolid, InsideOfASphereSurvivesSmallHoles) {
  const MeshSolid closed(close_surface(sphere_mesh(40, 60)));
  const MeshSolid pierced(
      close_surface(sphere_mesh(40, 60, 3)));  // without the cap of 13.5 degrees
  UniformRandom random(2);
  int differences = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    const Vector3d p = random.in_box(Vector3d::Constant(-1.2), Vector3d::Constant(1.2));
    if (closed.inside(p) != pierced.inside(p)) {
      ++differences;
      ASSERT_GT(p[1], 0.85) << "only near the hole: " << p.transpose();
    }
  }
  EXPECT_LT(differences, 40);
  EXPECT_NEAR(pierced.volume(), closed.volume(), 0.003 * closed.volume());
  EXPECT_NEAR(closed.volume(), 4 * M_PI / 3, 0.01 * 4 * M_PI / 3);
}

TEST(MeshSolid, OrientationDoesNotMatter) {
  PolygonMesh mesh = parse_obj(kCube, "cube.obj");
  for (auto& face : mesh.faces) std::reverse(face.begin(), face.end());
  const ClosedSurface surface = close_surface(mesh);
  EXPECT_TRUE(surface.warnings.empty());
  const MeshSolid solid(surface);
  EXPECT_TRUE(solid.inside({0.5, 0.5, 0.5}));
  EXPECT_FALSE(solid.inside({1.5, 0.5, 0.5}));
  EXPECT_NEAR(solid.volume(), 1, 1e-12);
}

TEST(MeshSolid, ParticlesOfACubeAreThoseOfTheBox) {
  EXPECT_EQ(fill_lattice(MeshSolid(close_surface(parse_obj(kCube, "cube.obj"))), 8).size(), 512u);
}

TEST(MeshSolid, FillsASphereOfAHundredThousandTriangles) {
  const PolygonMesh mesh = sphere_mesh(224, 224);
  ASSERT_GE(mesh.faces.size(), 99000u);
  const MeshSolid solid(close_surface(mesh));
  const std::vector<Vector3d> points = fill_lattice_nearest(solid, 5000);
  EXPECT_NEAR(points.size(), 5000, 900);
  for (const Vector3d& p : points) ASSERT_LT(p.norm(), 1);
}

struct BadObj {
  const char* name;
  const char* text;
  const char* message;
};

class RefusedObj : public testing::TestWithParam<BadObj> {};

TEST_P(RefusedObj, SaysWhatIsWrong) {
  try {
    close_surface(parse_obj(GetParam().text, "mesh.obj"));
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("mesh.obj"));
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, RefusedObj,
    testing::Values(
        BadObj{"empty", "", "no vertices"}, BadObj{"comments_only", "# nothing\n\n", "no vertices"},
        BadObj{"no_faces", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces: expected lines \"f i j k\""},
        BadObj{"not_a_number", "v 0 0 0\nv 1 0 abc\n",
               ":2: vertex: expected a finite number, found \"abc\""},
        BadObj{"nan", "v 0 nan 0\n", ":1: vertex: expected a finite number, found \"nan\""},
        BadObj{"infinite", "v 0 0 1e999\n", "expected a finite number, found \"1e999\""},
        BadObj{"two_coordinates", "v 0 0\n", "expected 3 coordinates, found 2"},
        BadObj{"index_too_large", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
               ":4: face index 4: expected 1 to 3"},
        BadObj{"index_zero", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "found \"0\""},
        BadObj{"index_too_negative", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -1 -2\n",
               "face index -4: only 3 vertices stand above it"},
        BadObj{"index_not_a_number", "v 0 0 0\nf 1 x 2\n", "found \"x\""},
        BadObj{"index_overflows", "v 0 0 0\nf 1 2 99999999999999999999\n",
               "found \"99999999999999999999\""},
        BadObj{"short_face", "v 0 0 0\nv 1 0 0\nf 1 2\n", "at least 3 vertices, found 2"},
        BadObj{"degenerate", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
               "mesh.obj:4: the faces from here on have no area"},
        BadObj{"degenerate_all", "v 0 0 0\nv 1 0 0\nf 1 2 2\n", "all 1 faces are degenerate"},
        BadObj{"one_triangle", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "encloses no volume"},
        BadObj{"flat_sheet", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
               "encloses no volume"},
        BadObj{"binary", "\x7f\x45\x4c\x46\x02\x01", "no vertices"}),
    [](const auto& info) { return info.param.name; });

TEST(Obj, RefusesFilesThatAreNotThere) {
  EXPECT_THROW(read_obj("/nonexistent/mesh.obj"), Error);
  EXPECT_THROW(read_obj("/"), Error);
}

}  // namespace
}  // namespace uniphy
