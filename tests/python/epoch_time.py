"""Seconds of an epoch of Algorithm 2 from Python and in C++, on the same observation.

  python3 tests/python/epoch_time.py BUILD_DIR OBSERVATION

Both run the same roll-out, loss, gradient by z and step of Adam, in turns; the fastest epoch of all
rounds counts. OMP_NUM_THREADS holds for both.
"""

import os
import subprocess
import sys
import time

import torch

build, observation = sys.argv[1:3]
os.environ.setdefault("UNIPHY_SOURCE_DIR", os.path.join(os.path.dirname(__file__), "../.."))
os.environ.setdefault("UNIPHY_BINARY_DIR", build)
os.environ.setdefault("UNIPHY_TORCH_LIBRARY", os.path.join(build, "lib/libuniphy_torch.so"))
os.environ.setdefault("UNIPHY_TORCH_VERSION", torch.__version__)

from support import MODEL, ops, read_observation, trained_networks  # noqa: E402

CODE, ROUNDS, EPOCHS = 0, 8, 10

networks, codes, materials = trained_networks(torch.float32)
seen = read_observation(observation)
x, v0, mass, volume = (seen[k].float() for k in ("x", "v0", "mass", "volume"))


def seconds_of_python():
    z = codes[CODE].float().requires_grad_()
    optimizer = torch.optim.Adam([z], lr=1e-3)
    fastest = float("inf")
    for _ in range(EPOCHS + 1):  # the first one warms up, as in C++
        start = time.perf_counter()
        optimizer.zero_grad()
        frames, _ = ops.rollout(x[0], v0, mass, volume, ["learned"], [z], seen["steps"],
                                seen["every"], **networks, **seen["grid"])
        torch.nn.functional.mse_loss(frames, x).backward()
        optimizer.step()
        fastest = min(fastest, time.perf_counter() - start)
    return fastest


def seconds_of_cpp():
    program = os.path.join(build, "bin/uniphy_rollout_gradient")
    command = [program, MODEL, observation, str(CODE), "float32", str(EPOCHS)]
    text = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    return float(text.split("seconds")[1])


python, cpp = [], []
for _ in range(ROUNDS):
    python.append(seconds_of_python())
    cpp.append(seconds_of_cpp())
    print(f"python {python[-1]:.4f} s, c++ {cpp[-1]:.4f} s", flush=True)
print(f"{x.shape[1]} particles, {seen['steps']} steps: fastest python {min(python):.4f} s, "
      f"c++ {min(cpp):.4f} s, ratio {min(python) / min(cpp):.3f}")
