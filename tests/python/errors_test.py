"""Bad arguments of torch.ops.uniphy raise a RuntimeError of one line that names them."""

import unittest

from support import message_of, ops, random_networks, torch

F = torch.eye(3, dtype=torch.float64).repeat(4, 1, 1)
x = torch.full((4, 3), 0.5, dtype=torch.float64)
one = torch.ones(4, dtype=torch.float64)
z = torch.zeros(5, dtype=torch.float64)
elastic = torch.tensor([1e4, 1e4])
networks = random_networks("isotropic", 5)


def rollout(laws=("elastic",), parameters=(elastic,), steps=2, **more):
    return ops.rollout(x, 0 * x, one, 1e-3 * one, laws, parameters, steps, **more)


class Errors(unittest.TestCase):
    def test_messages(self):
        cases = [
            (lambda: ops.svd3(F[0]),
             "svd3: F: expected [P, 3, 3] Float or Double on cpu, found [3, 3] Double on cpu"),
            (lambda: ops.return_mapping("clay", F, elastic, 1e-3),
             'return_mapping: law: expected one of elastic, newtonian, plasticine, sand, '
             'non_newtonian, fixed_corotated, water, volume_corrected_sand, mooney_rivlin, carreau, '
             'cohesive_sand, herschel_bulkley, learned; found "clay"'),
            (lambda: ops.return_mapping("volume_corrected_sand", F, z[:3] + 0.1, 1e-3),
             "return_mapping: law: expected one without memory, found volume_corrected_sand "
             "(return_mapping_with_memory takes it)"),
            (lambda: ops.return_mapping_with_memory("sand", F, one, z[:3] + 0.1, 1e-3),
             "return_mapping_with_memory: law: expected one with memory, found sand"),
            (lambda: ops.return_mapping_with_memory("volume_corrected_sand", F, one[:3],
                                                    z[:3] + 0.1, 1e-3),
             "return_mapping_with_memory: memory: expected [4] Double on cpu, found [3] Double"),
            (lambda: rollout(memory0=one[:2]),
             "rollout: memory0: expected [4] Double on cpu, found [2] Double on cpu"),
            (lambda: ops.return_mapping("learned", F, elastic, 1e-3),
             'return_mapping: law: expected an analytic one, found "learned"'),
            (lambda: ops.kirchhoff_stress("sand", F, None, elastic),
             "kirchhoff_stress: parameters: expected [3] Float on cpu, found [2] Float on cpu"),
            (lambda: ops.p2g(x, x, F, F, one, one, walls="sticky"),
             'p2g: walls: expected "freeslip" or "noslip", found "sticky"'),
            (lambda: ops.g2p(x, x, n=2**40), "g2p: grid: expected 4 to 1024 nodes a side, found "
             f"{2**31 - 1}"),
            (lambda: ops.grid_update(x, n=8), "grid_update: grid: expected [8, 8, 8, 4]"),
            (lambda: ops.learned_law(F, F, z, **dict(networks, form="round")),
             "learned_law: expected a form of the law from isotropic, published, found \"round\""),
            (lambda: ops.learned_project(F, z, **dict(networks, projection=z)),
             "learned_project: projection: expected [117] Double on cpu, found [5] Double on cpu"),
            (lambda: ops.learned_stress(F, F, z, **dict(networks, stress_widths=[11])),
             "learned_stress: stress_widths: expected two or more, found 1"),
            (lambda: ops.learned_law(F, F, z[:4], **networks), "projection.widths: expected "
             "[7, ..., 5] (features and latent first, outputs last), found [8, 8, 5]"),
            (lambda: rollout(["learned"], [z]),
             "rollout: a body is learned: expected form, activation, projection_widths, "),
            (lambda: rollout(["elastic", "sand"]), "rollout: expected as many laws as parameters "
             "and sizes, one or more (sizes may be left out for one body), found 2, 1 and 0"),
            (lambda: rollout(sizes=[3]), "rollout: bodies: expected the last one to end at "
             "particle 4, found 3"),
            (lambda: rollout(steps=-1),
             "rollout: expected steps >= 0 and every >= 1, found -1 and 1"),
            (lambda: rollout(dt=0.5), "likely cause"),
        ]
        for call, expected in cases:
            with self.subTest(expected):
                message = message_of(call)
                self.assertIn(expected, message)
                self.assertNotIn("\n", message)

    def test_second_derivatives_are_refused(self):
        leaf = (F + 0.1).requires_grad_()
        stress = ops.kirchhoff_stress("elastic", leaf, None, elastic)
        message = message_of(
            lambda: torch.autograd.grad(stress.sum(), leaf, create_graph=True))
        self.assertIn("kirchhoff_stress", message)
        self.assertNotIn("\n", message)


if __name__ == "__main__":
    unittest.main()
