"""Algorithm 2 with torch.ops.uniphy: the code z of a trained law that explains an observed motion.
  uniphy_simulate configs/simulate/benchmark_cube.yaml --set output.observation=true --out out/cube
  python3 experiments/algorithm2.py build/release/lib/libuniphy_torch.so \
    models/pretrained/unified.h5 out/cube/observation.h5 [epochs]"""
import sys, h5py, torch
torch.ops.load_library(sys.argv[1])
model, seen = h5py.File(sys.argv[2]), h5py.File(sys.argv[3])
tensor = lambda data: torch.tensor(data[:]).float()
codes, material = tensor(model["latents/z"]), model["latents/material"].asstr()[:]
law = {name: model.attrs[name].decode() for name in ("form", "activation")}
for name in ("projection", "stress"):  # one tensor: weight and bias of each layer in turn
    layers = [model[name][f"layer_{k}"] for k in range(len(model[name]))]
    law[name] = torch.cat([tensor(k[w]).flatten() for k in layers for w in ("weight", "bias")])
    law[name + "_widths"] = [k["weight"].shape[1] for k in layers] + [len(layers[-1]["bias"])]
x, volume = tensor(seen["x"]), tensor(seen["volume"])
scene = {k: v.decode() if k == "walls" else v.tolist() for k, v in seen["scene"].attrs.items()}
grid = {"n": scene["grid"], **{k: scene[k] for k in ("dt", "gravity", "walls", "bound")}}
every = round((seen["time"][1] - seen["time"][0]) / scene["dt"])  # evenly spaced frames
space = torch.cat([x[0], torch.ones(len(volume), 1)], 1)  # v0 = space @ motion is affine in x0
motion = (torch.linalg.pinv(space) @ (x[1] - x[0]) / (every * scene["dt"])).requires_grad_()
def loss_of(z):  # log of the mean squared error of the roll-out (m²)
    try:
        frames, _ = torch.ops.uniphy.rollout(
            x[0], space @ motion, scene["density"] * volume, volume, laws=["learned"],
            parameters=[z], steps=every * (len(x) - 1), every=every, **law, **grid)
    except RuntimeError as error:  # a particle that leaves the grid is as bad as 1 m²
        if "likely cause" in str(error): return torch.zeros((), requires_grad=True)
        raise
    return (frames - x).square().mean().log()
with torch.no_grad():
    z = min(codes, key=loss_of).clone().requires_grad_()
optimizer = torch.optim.LBFGS([z, motion], max_iter=5, line_search_fn="strong_wolfe")
def closure():
    optimizer.zero_grad()
    (loss := loss_of(z)).backward()
    return loss
for epoch in range(int(sys.argv[4]) if len(sys.argv) > 4 else 15):
    mse, away = optimizer.step(closure).exp(), (codes - z.detach()).norm(dim=1).tolist()
    nearest = min(range(len(away)), key=lambda k: ("random_" in material[k], away[k]))
    print(f"epoch {epoch}: {mse:.2e} m², nearest code {nearest} ({material[nearest]})", flush=True)
