#pragma once

#include <torch/library.h>

// The ops of Python: libuniphy_torch.so registers them as torch.ops.uniphy.
//
//   import torch
//   torch.ops.load_library("build/release/lib/libuniphy_torch.so")
//   stress = torch.ops.uniphy.kirchhoff_stress("elastic", F, None, parameters)
//
// Differentiable, once, by every tensor unless the op says that it is a constant; float32 or
// float64, all tensors of a call alike (parameters of analytic laws and codes of a roll-out may be
// of the other one), on the CPU. The formulas, units and errors are those of the ops of C++ in
// ops/. Bad arguments raise a RuntimeError of one line that names the op and the argument, what was
// expected and what was found.
//
// Three groups of arguments come up again:
//
// law, parameters: an analytic law by name ("elastic", "newtonian", "plasticine", "sand",
// "non_newtonian", "fixed_corotated", "water", "volume_corrected_sand", "mooney_rivlin", "carreau",
// "cohesive_sand", "herschel_bulkley") and its parameters [N] in this order, as far as the law has
// them: mu (Pa; newtonian: Pa s), lambda (Pa), tau_y (Pa), theta (rad), eta (Pa s;
// herschel_bulkley: Pa sⁿ), c1, c2 (Pa), eta_inf (Pa s), kappa (s), n, cohesion.
//
// form, activation, projection_widths, projection, stress_widths, stress: the networks of a learned
// law (attributes of model.h5), keywords. A network is one tensor [numbers], the weight [out, in],
// row-major, and the bias [out] of each layer one after the other, with the list of widths: what
// each layer takes, then what the last one gives. The first layer takes the features of the form,
// then the code z [Z].
//
// n, dt, gravity, walls, bound: the grid, keywords. Nodes a side of the unit cube, time step (s),
// gravity [3] (m/s²), "freeslip" or "noslip", thickness of the walls in nodes.

namespace uniphy::ops {

// What TORCH_LIBRARY calls, one function a file.
void define_laws(torch::Library& library);
void define_learned_law(torch::Library& library);
void define_mpm(torch::Library& library);
void define_rollout(torch::Library& library);

}  // namespace uniphy::ops
