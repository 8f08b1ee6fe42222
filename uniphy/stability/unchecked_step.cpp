#include "uniphy/stability/unchecked_step.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy::stability {
namespace {

/// The quadratic B-spline stencil of a position.
struct Stencil {
  int base[3];
  double w[3][3];  ///< [axis][node]

  Stencil(const double* x, double inverse_dx) {
    for (int a = 0; a < 3; ++a) {
      base[a] = static_cast<int>(std::floor(x[a] * inverse_dx - 0.5));
      const double f = x[a] * inverse_dx - base[a];
      w[a][0] = 0.5 * (1.5 - f) * (1.5 - f);
      w[a][1] = 0.75 - (f - 1) * (f - 1);
      w[a][2] = 0.5 * (f - 0.5) * (f - 0.5);
    }
  }

  /// f(node index, weight, x_node − x_p)
  template <class F>
  void each(const double* x, int n, double dx, const F& f) const {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < 3; ++k) {
          const double offset[3] = {(base[0] + i) * dx - x[0], (base[1] + j) * dx - x[1],
                                    (base[2] + k) * dx - x[2]};
          f(((base[0] + i) * n + base[1] + j) * n + base[2] + k, w[0][i] * w[1][j] * w[2][k],
            offset);
        }
      }
    }
  }
};

}  // namespace

UncheckedRollout::UncheckedRollout(const SceneDescription& scene, const PlacedScene& placed,
                                   double mass_epsilon)
    : grid_(placed.grid),
      mass_epsilon_(mass_epsilon),
      mass_(placed.mass),
      volume_(placed.volume),
      state_(ParticleState::undeformed(placed.x, placed.v)),
      tau_(9 * static_cast<std::size_t>(placed.particles())),
      nodes_(4 * static_cast<std::size_t>(grid_.n) * grid_.n * grid_.n) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    bodies_.push_back(
        {placed.first[b], placed.first[b + 1], kernels::make_law<double>(scene.bodies[b].law)});
  }
}

void UncheckedRollout::step() {
  deform();
  scatter();
  update_grid();
  gather();
}

void UncheckedRollout::deform() {
  for (std::size_t p = 0; p < mass_.size(); ++p) {
    double next[9];
    double* F = &state_.F[9 * p];
    const double* C = &state_.C[9 * p];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        next[3 * i + j] = F[3 * i + j] + grid_.dt * (C[3 * i] * F[j] + C[3 * i + 1] * F[3 + j] +
                                                     C[3 * i + 2] * F[6 + j]);
      }
    }
    std::copy(next, next + 9, F);
  }
  for (const auto& body : bodies_) {
    // A law takes chunks of kLawChunk particles.
    for (std::ptrdiff_t p = body.begin; p < body.end; p += kernels::kLawChunk) {
      const std::ptrdiff_t count = std::min(kernels::kLawChunk, body.end - p);
      body.law->evaluate(count, grid_.dt, {&state_.F[9 * p], 9, 1}, {&state_.C[9 * p], 9, 1},
                         {&state_.F[9 * p], 9, 1}, {&tau_[9 * p], 9, 1});
    }
  }
}

void UncheckedRollout::scatter() {
  std::fill(nodes_.begin(), nodes_.end(), 0.0);
  const double inverse = grid_.n;
  for (std::size_t p = 0; p < mass_.size(); ++p) {
    const double *x = &state_.x[3 * p], *v = &state_.v[3 * p], m = mass_[p];
    double A[9];
    for (int k = 0; k < 9; ++k) {
      A[k] = -grid_.dt * volume_[p] * 4 * inverse * inverse * tau_[9 * p + k] +
             m * state_.C[9 * p + k];
    }
    Stencil(x, inverse).each(x, grid_.n, grid_.dx(), [&](int node, double w, const double* d) {
      double* at = &nodes_[4 * static_cast<std::size_t>(node)];
      for (int a = 0; a < 3; ++a)
        at[a] += w * (m * v[a] + A[3 * a] * d[0] + A[3 * a + 1] * d[1] + A[3 * a + 2] * d[2]);
      at[3] += w * m;
    });
  }
}

void UncheckedRollout::update_grid() {
  const int n = grid_.n;
  std::size_t node = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k, ++node) {
        double* v = &nodes_[4 * node];
        const double mass = v[3] + mass_epsilon_;
        const int index[3] = {i, j, k};
        bool outwards[3], any = false;
        for (int a = 0; a < 3; ++a) {
          v[a] = (mass > 0 ? v[a] / mass : 0.0) + grid_.dt * grid_.gravity[a];
          outwards[a] =
              (index[a] < grid_.bound && v[a] < 0) || (index[a] > n - grid_.bound && v[a] > 0);
          any = any || outwards[a];
        }
        for (int a = 0; a < 3; ++a) {
          if (grid_.wall == kernels::Wall::noslip ? any : outwards[a]) v[a] = 0;
        }
      }
    }
  }
}

void UncheckedRollout::gather() {
  const double scale = 4.0 * grid_.n * grid_.n;
  const double low = 0.5 * grid_.dx(), high = (1 - 1e-9) - 1.5 * grid_.dx();
  for (std::size_t p = 0; p < mass_.size(); ++p) {
    double *x = &state_.x[3 * p], *v = &state_.v[3 * p], *C = &state_.C[9 * p];
    double sum[12] = {};
    Stencil(x, grid_.n).each(x, grid_.n, grid_.dx(), [&](int node, double w, const double* d) {
      const double* at = &nodes_[4 * static_cast<std::size_t>(node)];
      for (int a = 0; a < 3; ++a) {
        sum[a] += w * at[a];
        for (int b = 0; b < 3; ++b) sum[3 + 3 * a + b] += w * at[a] * d[b];
      }
    });
    for (int a = 0; a < 3; ++a) v[a] = sum[a];
    for (int k = 0; k < 9; ++k) C[k] = scale * sum[3 + k];
    for (int a = 0; a < 3; ++a) {
      x[a] += grid_.dt * v[a];
      // The comparison is false for NaN, which so goes to the wall.
      if (!(x[a] >= low)) x[a] = low;
      if (!(x[a] < high)) x[a] = high;
    }
  }
}

}  // namespace uniphy::stability
