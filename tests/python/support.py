"""What the tests of torch.ops.uniphy share: the library, the program's files, comparisons.

CTest sets UNIPHY_SOURCE_DIR, UNIPHY_BINARY_DIR and UNIPHY_TORCH_LIBRARY. Exit code 77 is a skipped
test: no PyTorch here, or another one than the library was built with.
"""

import os
import subprocess
import sys

SOURCE = os.environ["UNIPHY_SOURCE_DIR"]
BINARY = os.environ["UNIPHY_BINARY_DIR"]
LIBRARY = os.environ["UNIPHY_TORCH_LIBRARY"]
MODEL = os.path.join(SOURCE, "models/pretrained/unified.h5")


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(77)


try:
    import h5py
    import torch
except ImportError as error:
    skip(f"{error}; apt install python3-torch python3-h5py")

if torch.__version__.split(".")[:2] != os.environ["UNIPHY_TORCH_VERSION"].split(".")[:2]:
    skip(f"PyTorch {torch.__version__} of {sys.executable} is not the LibTorch of the build, "
         f"{os.environ['UNIPHY_TORCH_VERSION']}")

torch.ops.load_library(LIBRARY)
ops = torch.ops.uniphy

ANALYTIC_LAWS = {  # parameters in the order of the library, Pa, rad, Pa s
    "elastic": [4e3, 6e3],
    "newtonian": [20.0, 5e3],
    "plasticine": [4e3, 6e3, 300.0],
    "sand": [4e3, 6e3, 0.3],
    "non_newtonian": [4e3, 6e3, 300.0, 5.0],
    "fixed_corotated": [4e3, 6e3],
    "water": [6e3],
    "mooney_rivlin": [6e3, 3e3, 1e3],
    "carreau": [6e3, 30.0, 5.0, 0.3, 0.5],
    "cohesive_sand": [4e3, 6e3, 0.3, 0.01],
    "herschel_bulkley": [4e3, 6e3, 300.0, 5.0, 0.7],
}


def random_networks(form, latent_size, width=8, seed=1):
    """Untrained networks of a learned law, as the keywords that ops take."""
    torch.manual_seed(seed)
    projection_in, projection_out, stress_in, stress_out = {
        "isotropic": (3, 5, 6, 14), "published": (30, 9, 25, 9)}[form]

    def numbers(widths):
        parts = []
        for fan_in, out in zip(widths, widths[1:]):
            parts.append(torch.randn(out * fan_in, dtype=torch.float64) / fan_in**0.5)
            parts.append(0.3 * torch.randn(out, dtype=torch.float64))
        return torch.cat(parts)

    projection = [projection_in + latent_size, width, projection_out]
    stress = [stress_in + latent_size, width, stress_out]
    return dict(form=form, activation="gelu", projection_widths=projection,
                projection=numbers(projection), stress_widths=stress, stress=numbers(stress))


def trained_networks(dtype):
    """The networks, codes and materials of the model of the repository."""
    def network(group):
        layers = [group[f"layer_{k}"] for k in range(len(group))]
        widths = [layers[0]["weight"].shape[1]] + [layer["bias"].shape[0] for layer in layers]
        parts = [torch.tensor(layer[name][:]).flatten()
                 for layer in layers for name in ("weight", "bias")]
        return widths, torch.cat(parts).to(dtype)

    with h5py.File(MODEL) as file:
        law = {name: file.attrs[name].decode() for name in ("form", "activation")}
        for name in ("projection", "stress"):
            law[name + "_widths"], law[name] = network(file[name])
        codes = torch.tensor(file["latents/z"][:])
        return law, codes, list(file["latents/material"].asstr())


def observe(directory, steps, *settings):
    """Simulates a small benchmark cube; the path of its observation.h5."""
    command = [os.path.join(BINARY, "bin/uniphy_simulate"),
               os.path.join(SOURCE, "configs/simulate/benchmark_cube.yaml"), "--out", directory]
    for setting in ("output.observation=true", f"scene.steps={steps}", *settings):
        command += ["--set", setting]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    return os.path.join(directory, "observation.h5")


def read_observation(path):
    """The arguments of rollout that an observation gives, and the seen positions, float64."""
    with h5py.File(path) as file:
        scene = file["scene"].attrs
        volume = torch.tensor(file["volume"][:])
        every = round((file["time"][1] - file["time"][0]) / scene["dt"])
        x = torch.tensor(file["x"][:])
        grid = dict(n=int(scene["grid"]), dt=float(scene["dt"]),
                    gravity=scene["gravity"].tolist(), walls=scene["walls"].decode(),
                    bound=int(scene["bound"]))
        return dict(x=x, v0=(x[1] - x[0]) / (every * grid["dt"]),
                    mass=float(scene["density"]) * volume, volume=volume, every=every,
                    steps=every * (len(x) - 1), grid=grid)


def message_of(call):
    """What the exception of a call says."""
    try:
        call()
    except RuntimeError as error:
        return str(error)
    raise AssertionError("expected an error, found none")
