// Algorithm 2 of UniPhy's supplementary material, lines 4 to 16, in the order of its lines. Two of
// them wait: the transfer to the grid (line 5) takes the stress, so it follows lines 6 to 12.

#include "uniphy/inference/stepwise_rollout.hpp"

#include <string>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/laws/kirchhoff_stress.hpp"
#include "ops/laws/return_mapping.hpp"
#include "ops/learned/learned_law.hpp"
#include "ops/mpm/g2p.hpp"
#include "ops/mpm/grid_update.hpp"
#include "ops/mpm/p2g.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// memory is that of the body's particles, and is advanced where its law has one.
ops::LawOutput law_of(const ops::RolloutBody& body, const Tensor& F, const Tensor& C, double dt,
                      Tensor* memory) {
  if (body.law.id != kernels::LawId::learned && !body.networks.defined()) {
    const ops::Material material = body.parameters.defined()
                                       ? ops::material_of("rollout", body.law.id, body.parameters)
                                       : ops::material_of(body.law);
    Tensor F_proj;
    if (kernels::law_has_memory(body.law.id)) {
      const ops::MemoryMapping mapped =
          ops::return_mapping_with_memory(body.law.id, F, *memory, material, dt);
      F_proj = mapped.F_proj;
      *memory = mapped.memory;
    } else {
      F_proj = ops::return_mapping(body.law.id, F, material, dt);
    }
    return {F_proj, ops::kirchhoff_stress(body.law.id, F_proj, C, material)};
  }
  const Tensor z =
      (body.parameters.defined() ? body.parameters : torch::tensor(body.law.z, torch::kFloat64))
          .to(F.dtype());
  const Tensor F_proj =
      ops::learned_project(body.networks, F, z, dt);  // lines 7-9: SVD, g(F), F + Δ
  return {F_proj, ops::learned_stress(body.networks, F_proj, C, z)};  // lines 10-12: SVD, R, f, Ŝ
}

}  // namespace

ops::RolloutFrames stepwise_rollout(const Tensor& x0, const Tensor& v0, const Tensor& C0,
                                    const Tensor& F0, const Tensor& mass, const Tensor& volume,
                                    const std::vector<ops::RolloutBody>& given,
                                    const ops::RolloutSettings& settings, const Tensor& memory0) {
  std::vector<ops::RolloutBody> bodies = given;
  for (ops::RolloutBody& body : bodies) {
    if (body.law.weights && !body.networks.defined())
      body.networks = ops::to_networks(*body.law.weights, torch::kFloat64);
  }
  const kernels::GridSettings& grid = settings.grid;
  // Tracers, the last bodies, only read the grid.
  std::int64_t material = 0;
  for (const ops::RolloutBody& body : bodies) material = body.tracers ? material : body.end;
  const auto of_material = [material](const Tensor& t) { return t.slice(0, 0, material); };
  Tensor x = x0, v = v0;
  Tensor C = C0.defined() ? C0 : torch::zeros({x.size(0), 3, 3}, x.options());
  Tensor F = F0.defined() ? F0 : torch::eye(3, x.options()).repeat({x.size(0), 1, 1});
  std::vector<Tensor> memories;
  for (const ops::RolloutBody& body : bodies) {
    memories.push_back(memory0.defined() ? memory0.slice(0, body.begin, body.end)
                                         : torch::zeros({body.end - body.begin}, x.options()));
  }
  std::vector<Tensor> frames_x{x}, frames_v{v};
  for (std::ptrdiff_t step = 0; step < settings.steps; ++step) try {  // line 4
      F = F + grid.dt * torch::bmm(C, F);                             // line 6
      std::vector<Tensor> F_proj, tau;
      for (std::size_t b = 0; b < bodies.size(); ++b) {  // lines 7 to 12
        const ops::RolloutBody& body = bodies[b];
        if (body.tracers) {
          F_proj.push_back(F.slice(0, body.begin, body.end).detach());
          continue;
        }
        const auto own = [&body](const Tensor& t) { return t.slice(0, body.begin, body.end); };
        const ops::LawOutput law = law_of(body, own(F), own(C), grid.dt, &memories[b]);
        F_proj.push_back(law.F_proj);
        tau.push_back(law.tau);
      }
      F = torch::cat(F_proj);
      const Tensor nodes = ops::p2g(of_material(x), of_material(v), of_material(C), torch::cat(tau),
                                    of_material(mass), of_material(volume),
                                    grid);                     // line 5
      const Tensor velocity = ops::grid_update(nodes, grid);   // line 13
      const ops::G2p particles = ops::g2p(x, velocity, grid);  // line 14
      x = particles.x;                                         // line 15
      v = particles.v;
      C = particles.C;
      if ((step + 1) % settings.every != 0) continue;
      frames_x.push_back(x);
      frames_v.push_back(v);
    } catch (const Error& error) {
      throw Error("rollout: step " + std::to_string(step) + ": " + error.what());
    }
  return {torch::stack(frames_x), settings.velocities ? torch::stack(frames_v) : Tensor()};
}

}  // namespace uniphy
