"""torch.autograd.gradcheck of every op of torch.ops.uniphy, in float64.

Positive numbers (moduli, mass, volume) enter as logarithms, so that one step of the differences
suits all, and results are divided by their size. Inputs are random: none stands on a kink.
"""

import unittest

from support import ANALYTIC_LAWS, ops, random_networks, torch


def normal(*sizes, scale=1.0):
    return scale * torch.randn(*sizes, dtype=torch.float64)


def deformations(count, strain, seed=1):
    torch.manual_seed(seed)
    return torch.eye(3, dtype=torch.float64) + normal(count, 3, 3, scale=strain)


PLASTIC = ("plasticine", "sand", "non_newtonian", "cohesive_sand", "herschel_bulkley")


class Gradients(unittest.TestCase):
    def check(self, function, *inputs, every_input_counts=True):
        """gradcheck, and that no gradient is zero."""
        leaves = [t.detach().clone().requires_grad_() for t in inputs]
        self.assertTrue(torch.autograd.gradcheck(function, leaves, eps=1e-6, atol=1e-7, rtol=1e-5))
        results = function(*leaves)
        results = results if isinstance(results, tuple) else (results,)
        torch.manual_seed(9)
        loss = sum((torch.randn_like(r) * r).sum() for r in results)
        for k, gradient in enumerate(torch.autograd.grad(loss, leaves)):
            self.assertTrue(torch.isfinite(gradient).all())
            if every_input_counts:
                self.assertGreater(gradient.abs().max().item(), 1e-6, f"input {k}")

    def test_svd3(self):
        def invariant(F):  # singular vectors come with a sign and a turn that are free
            U, sigma, Vh = ops.svd3(F)
            return sigma, U @ Vh, U @ (sigma.log()[:, :, None] * U.transpose(1, 2))

        self.check(invariant, deformations(3, 0.2))

    def test_return_mapping(self):
        for law, numbers in ANALYTIC_LAWS.items():
            with self.subTest(law):
                logarithms = torch.tensor(numbers, dtype=torch.float64).log()
                F = deformations(8, 0.15)
                with torch.no_grad():
                    projected = ops.return_mapping(law, F, logarithms.exp(), 1e-2)
                changed = (projected != F).flatten(1).any(1)
                if law in PLASTIC:
                    self.assertTrue(changed.any())
                # The strength is what a projection depends on; moduli alone change nothing.
                self.check(lambda F, p: ops.return_mapping(law, F, p.exp(), 1e-2), F, logarithms,
                           every_input_counts=law in PLASTIC)

    def test_return_mapping_with_memory(self):
        logarithms = torch.tensor(ANALYTIC_LAWS["sand"], dtype=torch.float64).log()
        F = deformations(8, 0.05)
        memory = torch.linspace(0.02, 0.3, 8, dtype=torch.float64)
        law = "volume_corrected_sand"
        projected, after = ops.return_mapping_with_memory(law, F, memory, logarithms.exp(), 1e-3)
        # The volume is in F or in the memory.
        volume = torch.linalg.det(F).log() + memory - torch.linalg.det(projected).log()
        self.assertTrue(torch.allclose(after, volume, atol=1e-13))
        self.assertTrue((after == 0).any() and (after > 0).any())
        self.check(lambda F, m, p: ops.return_mapping_with_memory(law, F, m, p.exp(), 1e-3), F,
                   memory, logarithms)

    def test_kirchhoff_stress(self):
        torch.manual_seed(2)
        C = normal(4, 3, 3, scale=10)
        for law, numbers in ANALYTIC_LAWS.items():
            with self.subTest(law):
                logarithms = torch.tensor(numbers, dtype=torch.float64).log()

                def stress(F, C, p):
                    return ops.kirchhoff_stress(law, F, C, p.exp()) / 1e3

                F = deformations(4, 0.1)
                self.check(stress, F, C, logarithms, every_input_counts=law in ("newtonian", "carreau"))
                # Without C it is zero.
                self.assertTrue(torch.equal(
                    ops.kirchhoff_stress(law, F, None, logarithms.exp()),
                    ops.kirchhoff_stress(law, F, torch.zeros_like(F), logarithms.exp())))

    grid = dict(n=8, dt=1e-2, gravity=[1.0, -9.8, 0.5], bound=2)

    def particles(self):
        torch.manual_seed(3)
        x = 0.3 + 0.4 * torch.rand(4, 3, dtype=torch.float64)
        return x, normal(4, 3), normal(4, 3, 3), normal(4, 3, 3), normal(4), normal(4)

    def test_p2g(self):
        def p2g(x, v, C, tau, mass, volume):
            return ops.p2g(x, v, C, 1e3 * tau, 1e-2 * mass.exp(), 1e-5 * volume.exp(),
                           **self.grid) * 1e2

        self.check(p2g, *self.particles())

    def test_grid_update(self):
        torch.manual_seed(4)
        for walls in ("freeslip", "noslip"):
            with self.subTest(walls):
                momentum, mass = normal(8, 8, 8, 3), normal(8, 8, 8, 1, scale=0.3).exp()
                settings = dict(self.grid, walls=walls, n=8)
                grid = torch.cat([momentum, mass], 3)
                found = ops.grid_update(grid, **settings)
                self.assertTrue((found == 0).any())  # walls
                # A part of the nodes, for the Jacobian's size: a corner and the middle.
                nodes = [(0, 0, 0), (1, 4, 4), (4, 4, 4), (4, 7, 3)]

                def update(part):
                    whole = grid.clone()
                    for k, node in enumerate(nodes):
                        whole[node] = part[k]
                    return torch.stack([ops.grid_update(whole, **settings)[n] for n in nodes])

                self.check(update, torch.stack([grid[node] for node in nodes]))

    def test_g2p(self):
        torch.manual_seed(5)
        self.check(lambda x, velocity: ops.g2p(x, velocity, **self.grid), self.particles()[0],
                   normal(8, 8, 8, 3))

    def test_learned_law(self):
        torch.manual_seed(6)
        C, z = normal(3, 3, 3), normal(5, scale=0.3)
        for form in ("isotropic", "published"):
            with self.subTest(form):
                F, networks = deformations(3, 0.2), random_networks(form, 5)
                scale = ops.learned_law(F, C, z, **networks)[1].abs().max()

                weights = networks.pop("projection"), networks.pop("stress")

                def law(F, C, z, projection, stress):
                    F_proj, tau = ops.learned_law(F, C, z, projection=projection, stress=stress,
                                                  **networks)
                    return F_proj, tau / scale

                def project(F, z, projection):
                    return ops.learned_project(F, z, projection=projection, stress=weights[1],
                                               **networks)

                def stress(F, C, z, stress):
                    return ops.learned_stress(F, C, z, projection=weights[0], stress=stress,
                                              **networks) / scale

                self.check(law, F, C, z, *weights)
                self.check(project, F, z, weights[0])
                self.check(stress, F, C, z, weights[1])

    def test_rollout(self):
        torch.manual_seed(7)
        x = 0.35 + 0.3 * torch.rand(6, 3, dtype=torch.float64)
        networks = random_networks("isotropic", 4)
        inputs = (x, normal(6, 3), normal(6, 3, 3), deformations(6, 0.1),
                  torch.tensor([4e3, 6e3], dtype=torch.float64).log(), normal(4, scale=0.3),
                  networks.pop("projection"), networks.pop("stress"))
        volume = torch.full((6,), 1e-3, dtype=torch.float64)

        def roll(x0, v0, C0, F0, elastic, z, projection, stress):
            x, v = ops.rollout(x0, v0, 1e3 * volume, volume, ["elastic", "learned"],
                               [elastic.exp(), z], steps=6, every=2, velocities=True, C0=C0, F0=F0,
                               sizes=[4, 2], projection=projection, stress=stress, **networks,
                               n=8, dt=2e-4, bound=2)
            return x, v

        self.check(roll, *inputs)
        frames = roll(*inputs)
        self.assertEqual(list(frames[0].shape), [4, 6, 3])
        self.assertTrue(torch.equal(frames[0][0], x))


if __name__ == "__main__":
    unittest.main()
