"""experiments/algorithm2.py on the model of the repository and an observation made here."""

import os
import re
import subprocess
import sys
import tempfile
import unittest

from support import LIBRARY, MODEL, SOURCE, observe


class Algorithm2(unittest.TestCase):
    def test_loss_falls_and_the_material_is_found(self):
        script = os.path.join(SOURCE, "experiments/algorithm2.py")
        with open(script) as lines:
            self.assertLessEqual(len(list(lines)), 40)
        with tempfile.TemporaryDirectory() as directory:
            observation = observe(directory, 500, "bodies.0.filling.count=6")
            text = subprocess.run([sys.executable, script, LIBRARY, MODEL, observation, "12"],
                                  check=True, stdout=subprocess.PIPE, text=True).stdout
        print(text)
        epochs = re.findall(r"epoch \d+: (\S+) m², nearest code \d+ \((\w+)\)", text)
        self.assertEqual(len(epochs), 12)
        self.assertLess(float(epochs[-1][0]), 0.1 * float(epochs[0][0]))
        self.assertEqual(epochs[-1][1], "elastic")


if __name__ == "__main__":
    unittest.main()
