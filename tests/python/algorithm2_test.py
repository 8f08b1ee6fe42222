"""experiments/algorithm2.py on the model of the repository and an observation made here."""

import os
import re
import subprocess
import sys
import tempfile
import unittest

from support import LIBRARY, MODEL, SOURCE, observe, ops, torch, trained_networks


class Algorithm2(unittest.TestCase):
    def test_loss_falls_and_an_elastic_law_is_found(self):
        script = os.path.join(SOURCE, "experiments/algorithm2.py")
        with open(script) as lines:
            self.assertLessEqual(len(list(lines)), 40)
        with tempfile.TemporaryDirectory() as directory:
            observation = observe(directory, 500, "bodies.0.filling.count=6")
            text = subprocess.run([sys.executable, script, LIBRARY, MODEL, observation, "12"],
                                  check=True, stdout=subprocess.PIPE, text=True).stdout
        print(text)
        epochs = re.findall(r"epoch \d+: (\S+) m², nearest code (\d+) \((\w+)\)", text)
        self.assertEqual(len(epochs), 12)
        self.assertLess(float(epochs[-1][0]), 0.1 * float(epochs[0][0]))
        # A non-Newtonian material that does not yield is elastic, too: what counts is that the law
        # returns F as it is.
        networks, codes, materials = trained_networks(torch.float64)
        torch.manual_seed(1)
        F = torch.eye(3, dtype=torch.float64) + 0.1 * torch.randn(200, 3, 3, dtype=torch.float64)
        kept = [torch.equal(ops.learned_project(F, z.double(), **networks), F) for z in codes]
        self.assertTrue(kept[int(epochs[-1][1])], epochs[-1])
        self.assertFalse(any(k for k, name in zip(kept, materials) if name == "plasticine"))


if __name__ == "__main__":
    unittest.main()
