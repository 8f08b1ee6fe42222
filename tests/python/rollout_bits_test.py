"""The roll-out from Python has the bits of the program in C++ (rollout_gradient.cpp)."""

import os
import subprocess
import tempfile
import unittest

from support import BINARY, MODEL, observe, ops, read_observation, torch, trained_networks


def found_by_cpp(observation, code, dtype):
    program = os.path.join(BINARY, "bin/uniphy_rollout_gradient")
    lines = subprocess.run([program, MODEL, observation, str(code), dtype, "0"], check=True,
                           stdout=subprocess.PIPE, text=True).stdout.splitlines()
    return {name: [float.fromhex(n) for n in numbers]
            for name, *numbers in (line.split() for line in lines)}


class Bits(unittest.TestCase):
    def test_loss_and_gradient(self):
        with tempfile.TemporaryDirectory() as directory:
            observation = observe(directory, 150)
            seen = read_observation(observation)
            for dtype in (torch.float32, torch.float64):
                networks, codes, materials = trained_networks(dtype)
                for code, yields in ((materials.index("elastic"), False),
                                     (materials.index("sand"), True)):
                    with self.subTest(f"{dtype} {materials[code]}"):
                        expected = found_by_cpp(observation, code, str(dtype).split(".")[1])
                        z = codes[code].to(dtype).requires_grad_()
                        for name in ("projection", "stress"):
                            networks[name] = networks[name].detach().requires_grad_()
                        x, v0, mass, volume = (
                            seen[k].to(dtype) for k in ("x", "v0", "mass", "volume"))
                        frames, _ = ops.rollout(x[0], v0, mass, volume, ["learned"], [z],
                                                seen["steps"], seen["every"], **networks,
                                                **seen["grid"])
                        loss = torch.nn.functional.mse_loss(frames, x)
                        loss.backward()
                        self.assertEqual([loss.item()], expected["loss"])
                        self.assertEqual(z.grad.tolist(), expected["z"])
                        self.assertTrue(all(g != 0 for g in expected["z"]))
                        for name, moves in (("projection", yields), ("stress", True)):
                            self.assertEqual(networks[name].grad.tolist(), expected[name])
                            self.assertEqual(any(g != 0 for g in expected[name]), moves)


if __name__ == "__main__":
    unittest.main()
