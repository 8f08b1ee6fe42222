#include "ops/kernels/mpm/transfers.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "ops/kernels/mpm/grid_plan.hpp"
#include "ops/kernels/mpm/mpm_table.hpp"
#include "ops/kernels/simd/aligned_buffer.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/on_threads.hpp"

namespace uniphy::kernels {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

template <class T>
struct Cloud {
  GridSettings grid;
  std::ptrdiff_t count;
  std::vector<T> x, v, C, tau, mass, volume;

  explicit Cloud(std::ptrdiff_t particles, double half_width = 0.2) : count(particles) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const auto draw = [&](std::vector<T>& to, std::ptrdiff_t size, double at, double width) {
      for (std::ptrdiff_t k = 0; k < size; ++k) to.push_back(T(at + width * uniform(random)));
    };
    draw(x, 3 * count, 0.5, half_width);
    draw(v, 3 * count, 0, 2);
    draw(C, 9 * count, 0, 10);
    draw(tau, 9 * count, 0, 1e4);
    draw(mass, count, 0.1, 0.05);
    draw(volume, count, 1e-4, 5e-5);
  }
  ParticleArrays<T> arrays() const {
    return {count, x.data(), v.data(), C.data(), tau.data(), mass.data(), volume.data()};
  }
  std::vector<T> to_grid() const {
    std::vector<T> out(std::size_t(grid.n) * grid.n * grid.n * 4);
    p2g(grid, arrays(), out.data());
    return out;
  }
};

template <class T>
class TransfersOfType : public ::testing::Test {};
using Types = ::testing::Types<float, double>;
TYPED_TEST_SUITE(TransfersOfType, Types);

TYPED_TEST(TransfersOfType, P2gConservesMassMomentumAndAngularMomentum) {
  using T = TypeParam;
  const Cloud<T> cloud(500);
  const std::vector<T> grid = cloud.to_grid();
  const int n = cloud.grid.n;
  double particles[7] = {}, nodes[7] = {}, scale[7] = {};
  const auto add = [&](double* to, const double* x, const double* p, double m) {
    const double l[3] = {x[1] * p[2] - x[2] * p[1], x[2] * p[0] - x[0] * p[2],
                         x[0] * p[1] - x[1] * p[0]};
    for (int a = 0; a < 3; ++a) to[a] += p[a], to[3 + a] += l[a];
    to[6] += m;
  };
  for (std::ptrdiff_t q = 0; q < cloud.count; ++q) {
    const double m = cloud.mass[q], dx = cloud.grid.dx();
    const double x[3] = {cloud.x[3 * q], cloud.x[3 * q + 1], cloud.x[3 * q + 2]};
    const double p[3] = {m * cloud.v[3 * q], m * cloud.v[3 * q + 1], m * cloud.v[3 * q + 2]};
    add(particles, x, p, m);
    // A carries the angular momentum of its skew part, by Σ w (x_n − x_p)(x_n − x_p)ᵀ = Δx²/4 I;
    // the random τ here is not symmetric and adds its own.
    const double factor = -cloud.grid.dt * cloud.volume[q];
    const auto A = [&](int a, int b) {
      const int k = 3 * a + b;
      return factor * cloud.tau[9 * q + k] + dx * dx / 4 * m * cloud.C[9 * q + k];
    };
    particles[3] += A(2, 1) - A(1, 2);
    particles[4] += A(0, 2) - A(2, 0);
    particles[5] += A(1, 0) - A(0, 1);
    for (int a = 0; a < 3; ++a) scale[a] += std::abs(p[a]), scale[3 + a] += std::abs(p[a]);
    scale[6] += m;
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        const T* node = &grid[((std::size_t(i) * n + j) * n + k) * 4];
        const double x[3] = {double(i) / n, double(j) / n, double(k) / n};
        const double p[3] = {node[0], node[1], node[2]};
        add(nodes, x, p, node[3]);
      }
    }
  }
  for (int k = 0; k < 7; ++k) {
    EXPECT_NEAR(nodes[k], particles[k], 4 * std::numeric_limits<T>::epsilon() * scale[k]) << k;
  }
}

TYPED_TEST(TransfersOfType, G2pReproducesLinearFields) {
  using T = TypeParam;
  const Cloud<T> cloud(300);
  const int n = cloud.grid.n;
  const double a[3] = {1, -2, 0.5}, B[9] = {3, -1, 2, 0.5, -4, 1, -2, 0.3, 1};
  std::vector<T> field(std::size_t(n) * n * n * 3);
  std::size_t at = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        const double x[3] = {double(i) / n, double(j) / n, double(k) / n};
        for (int c = 0; c < 3; ++c) {
          field[at++] = T(a[c] + B[3 * c] * x[0] + B[3 * c + 1] * x[1] + B[3 * c + 2] * x[2]);
        }
      }
    }
  }
  std::vector<T> x(3 * cloud.count), v(3 * cloud.count), C(9 * cloud.count);
  g2p(cloud.grid, cloud.count, cloud.x.data(), field.data(), x.data(), v.data(), C.data());
  const double eps = std::numeric_limits<T>::epsilon();
  for (std::ptrdiff_t p = 0; p < cloud.count; ++p) {
    const T* at = &cloud.x[3 * p];
    for (int c = 0; c < 3; ++c) {
      const double expected = a[c] + B[3 * c] * at[0] + B[3 * c + 1] * at[1] + B[3 * c + 2] * at[2];
      EXPECT_NEAR(v[3 * p + c], expected, 40 * eps);
      EXPECT_NEAR(x[3 * p + c], at[c] + cloud.grid.dt * v[3 * p + c], 2 * eps);
      for (int b = 0; b < 3; ++b) {
        EXPECT_NEAR(C[9 * p + 3 * c + b], B[3 * c + b], 100 * n * eps);
      }
    }
  }
}

TYPED_TEST(TransfersOfType, TheWholeTransferConservesMomentum) {
  using T = TypeParam;
  Cloud<T> cloud(500);
  for (double& g : cloud.grid.gravity) g = 0;
  const std::vector<T> grid = cloud.to_grid();
  std::vector<T> velocity(grid.size() / 4 * 3), x(3 * cloud.count), v(x), C(9 * cloud.count);
  grid_update(cloud.grid, grid.data(), velocity.data());
  g2p(cloud.grid, cloud.count, cloud.x.data(), velocity.data(), x.data(), v.data(), C.data());
  for (int a = 0; a < 3; ++a) {
    double before = 0, after = 0, scale = 0;
    for (std::ptrdiff_t p = 0; p < cloud.count; ++p) {
      before += double(cloud.mass[p]) * cloud.v[3 * p + a];
      after += double(cloud.mass[p]) * v[3 * p + a];
      scale += double(cloud.mass[p]) * std::abs(cloud.v[3 * p + a]);
    }
    EXPECT_NEAR(after, before, std::numeric_limits<T>::epsilon() * scale);
  }
}

TYPED_TEST(TransfersOfType, WallsActWhereAndOnlyWhereTheyShould) {
  using T = TypeParam;
  for (const Wall wall : {Wall::freeslip, Wall::noslip}) {
    GridSettings settings;
    settings.n = 10;
    settings.wall = wall;
    settings.gravity[0] = settings.gravity[1] = settings.gravity[2] = 0;
    const int n = settings.n;
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    std::vector<T> grid(4000), velocity(3000);
    for (std::size_t k = 0; k < 1000; ++k) {
      for (int a = 0; a < 3; ++a) grid[4 * k + a] = T(2 * normal(random));
      grid[4 * k + 3] = T(k % 7 == 0 ? 0 : 2);
    }
    grid_update(settings, grid.data(), velocity.data());
    int clamped = 0;
    for (int k = 0; k < 1000; ++k) {
      const int index[3] = {k / 100, k / 10 % 10, k % 10};
      T expected[3];
      bool outward[3], any = false;
      for (int a = 0; a < 3; ++a) {
        const T v = grid[4 * k + 3] > 0 ? grid[4 * k + a] / 2 : T(0);
        outward[a] = (index[a] < 3 && v < 0) || (index[a] > n - 3 && v > 0);
        any = any || outward[a];
        expected[a] = v;
      }
      for (int a = 0; a < 3; ++a) {
        if (outward[a] || (any && wall == Wall::noslip)) expected[a] = 0, ++clamped;
        EXPECT_EQ(velocity[3 * k + a], expected[a]) << k << " " << a;
      }
    }
    EXPECT_GT(clamped, 500);
  }
}

TYPED_TEST(TransfersOfType, GravityActsOnEmptyNodesToo) {
  using T = TypeParam;
  GridSettings settings;
  std::vector<T> grid(8000 * 4, T(0)), velocity(8000 * 3);
  grid_update(settings, grid.data(), velocity.data());
  const int centre = (10 * 20 + 10) * 20 + 10;
  EXPECT_EQ(velocity[3 * centre], 0);
  EXPECT_EQ(velocity[3 * centre + 1], T(settings.dt * -9.8));
  EXPECT_EQ(velocity[1], 0);  // the floor
}

TYPED_TEST(TransfersOfType, SameBitsOnAnyNumberOfThreads) {
  const Cloud<TypeParam> cloud(3000);
  const auto to_grid = [&] { return cloud.to_grid(); };
  const auto one = testing::on_threads(1, to_grid);
  EXPECT_EQ(one, testing::on_threads(2, to_grid));
  EXPECT_EQ(one, testing::on_threads(3, to_grid));
}

/// The loops of one instruction set on one chunk, layer by layer or at once.
template <class T>
std::vector<T> scatter_and_gather(Isa isa, const Cloud<T>& cloud, int layers_at_once) {
  const MpmTable<T>& table = mpm_table<T>(isa);
  const StepConstants<T> constants(cloud.grid);
  const int count = int(cloud.count);
  AlignedBuffer<T> state(kStateChunkSize), tau(kMatrixChunkSize), mass(kChunk), volume(kChunk),
      moments(kGatherAdjointPlanes * kChunk), nodes(grid_size(cloud.grid.n));
  AlignedBuffer<TransferChunk<T>> chunk(1);
  for (AlignedBuffer<T>* b : {&state, &tau, &mass, &volume, &moments, &nodes}) b->fill(T(0));
  chunk.fill(TransferChunk<T>{});
  for (int l = 0; l < count; ++l) {
    mass[l] = cloud.mass[l];
    volume[l] = cloud.volume[l];
    for (int a = 0; a < 3; ++a) {
      state[(kPlaneX + a) * kChunk + l] = cloud.x[3 * l + a];
      state[(kPlaneV + a) * kChunk + l] = cloud.v[3 * l + a];
    }
    for (int k = 0; k < 9; ++k) {
      state[(kPlaneC + k) * kChunk + l] = cloud.C[9 * l + k];
      tau[k * kChunk + l] = cloud.tau[9 * l + k];
    }
  }
  const GridView<T> grid = grid_view(nodes.data(), cloud.grid.n);
  const GridView<const T> filled{grid.data, grid.row_stride, grid.layer_stride};
  table.stencil(state.data(), count, constants, chunk.data());
  table.p2g_records(state.data(), tau.data(), mass.data(), volume.data(), constants, chunk.data());
  for (int i = 0; i < cloud.grid.n; i += layers_at_once) {
    table.scatter(chunk[0], grid, i, std::min(i + layers_at_once, cloud.grid.n));
  }
  std::vector<T> result(nodes.data(), nodes.data() + nodes.size());
  const auto keep = [&](int planes) {
    for (int k = 0; k < planes; ++k) {
      result.insert(result.end(), &moments[k * kChunk], &moments[k * kChunk] + count);
    }
  };
  table.gather(chunk[0], filled, moments.data());
  keep(kGatherPlanes);
  table.gather_adjoint(chunk[0], filled, moments.data());
  keep(kGatherAdjointPlanes);
  table.gather_slopes(chunk[0], filled, moments.data());
  for (int k = 16; k < 19; ++k) {
    for (int l = 0; l < count; ++l) result.push_back(moments[k * kChunk + l]);
  }
  return result;
}

TYPED_TEST(TransfersOfType, InstructionSetsAgreeWithinRounding) {
  using T = TypeParam;
  for (const int count : {1, 13, 64}) {
    const Cloud<T> cloud(count);
    const std::vector<T> baseline = scatter_and_gather(Isa::baseline, cloud, cloud.grid.n);
    // Each number of the nodes and each plane of the moments by its own size.
    const std::size_t nodes = grid_size(cloud.grid.n);
    const auto part = [&](std::size_t k) { return k < nodes ? k % 4 : 4 + (k - nodes) / count; };
    std::vector<double> scale(part(baseline.size()));
    for (std::size_t k = 0; k < baseline.size(); ++k)
      scale[part(k)] = std::max(scale[part(k)], std::abs(double(baseline[k])));
    for (const Isa isa : available_isas()) {
      const std::vector<T> found = scatter_and_gather(isa, cloud, cloud.grid.n);
      for (std::size_t k = 0; k < baseline.size(); ++k) {
        EXPECT_NEAR(found[k], baseline[k], 16 * std::numeric_limits<T>::epsilon() * scale[part(k)])
            << isa_name(isa) << " " << k;
      }
    }
  }
}

TYPED_TEST(TransfersOfType, CuttingTheGridDoesNotChangeABit) {
  const Cloud<TypeParam> cloud(64);
  for (const Isa isa : available_isas()) {
    const auto whole = scatter_and_gather(isa, cloud, cloud.grid.n);
    for (const int layers : {1, 2, 3, 5}) {
      EXPECT_EQ(whole, scatter_and_gather(isa, cloud, layers)) << isa_name(isa) << " " << layers;
    }
  }
}

TEST(GridPlan, SharesEveryTouchedLayerOnce) {
  const int n = 40;
  std::vector<TransferChunk<float>> chunks(3);
  const int base[3] = {5, 6, 20};
  for (int c = 0; c < 3; ++c) {
    chunks[c].count = 64;
    for (int a = 0; a < 3; ++a)
      chunks[c].base_min[a] = base[c], chunks[c].base_max[a] = base[c] + 2;
  }
  GridPlan plan;
  plan.build(chunks.data(), 3, n);
  EXPECT_EQ(plan.layer_begin(), 5);
  EXPECT_EQ(plan.layer_end(), 25);
  EXPECT_EQ(plan.box(5).nodes(), 25);
  EXPECT_EQ(plan.box(7).nodes(), 36);
  EXPECT_TRUE(plan.box(15).empty());  // between the two
  for (const int parts : {1, 2, 3, 7, 64}) {
    EXPECT_EQ(plan.cut(0, parts), 5);
    EXPECT_EQ(plan.cut(parts, parts), 25);
    for (int p = 0; p < parts; ++p) EXPECT_LE(plan.cut(p, parts), plan.cut(p + 1, parts));
  }
  // Half of the work: 15 pairs of a chunk and a layer, of which layers 5 to 8 hold 1 + 2 + 2 + 2.
  EXPECT_GE(plan.cut(1, 2), 8);
  EXPECT_LE(plan.cut(1, 2), 10);
}

TEST(Transfers, StencilsThatLeaveTheGridAreErrors) {
  // The stencil of x in [Δx/2, 1 − 3Δx/2) is on the grid.
  GridSettings settings;
  const std::vector<double> zero(9, 0), one(1, 1);
  std::vector<double> grid(8000 * 4);
  const auto transfer = [&](double x) {
    const std::vector<double> at = {0.5, x, 0.5};
    p2g<double>(settings,
                {1, at.data(), zero.data(), zero.data(), zero.data(), one.data(), one.data()},
                grid.data());
  };
  const auto message = [&](double x) { return testing::error_of([&] { transfer(x); }); };
  EXPECT_NO_THROW(transfer(0.025));
  EXPECT_NO_THROW(transfer(0.9249999));
  EXPECT_THAT(message(0.0249999),
              AllOf(HasSubstr("particle 0 at (0.5, 0.0249999, 0.5)"), HasSubstr("[0.025, 0.925)")));
  EXPECT_THAT(message(0.925), HasSubstr("leaves the grid"));
  EXPECT_THAT(message(-1e30), HasSubstr("leaves the grid"));
  EXPECT_THAT(message(std::nan("")), HasSubstr("leaves the grid"));
}

}  // namespace
}  // namespace uniphy::kernels
