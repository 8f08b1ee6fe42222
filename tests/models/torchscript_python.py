"""An exported law as a user in Python meets it, with nothing of this project but the file:
    python3 torchscript_python.py LAW.pt SCRIPTS
Loads the law, takes the code of a material, differentiates at F = I (published form: at singular
values apart) and holds that against central differences. Then runs the methods of SCRIPTS
(models/script) in plain PyTorch on the same numbers. Exit status 77: no torch here.
"""

import sys

try:
    import torch
except ImportError as error:
    print("skipped:", error)
    sys.exit(77)


def central_difference(f, x, h=2e-5):
    gradient = torch.zeros_like(x)
    for k in range(x.numel()):
        step = torch.zeros(x.numel(), dtype=x.dtype)
        step[k] = h
        step = step.reshape(x.shape)
        gradient.view(-1)[k] = (8 * (f(x + step) - f(x - step))
                                - (f(x + 2 * step) - f(x - 2 * step))) / (12 * h)
    return gradient


def difference(a, b):
    """Relative; of what is zero but for rounding, the difference itself."""
    scale = b.norm().item()
    return (a - b).norm().item() / (scale if scale > 1e-3 else 1)


def check_gradients(law, F, C, z):
    generator = torch.Generator().manual_seed(5)
    weight = torch.randn(F.shape, generator=generator, dtype=torch.float64)
    losses = [lambda F, C, z: (weight * law.project(F, z)).sum(),
              lambda F, C, z: (weight * law.stress(F, C, z)).sum()]
    for loss in losses:
        x = [t.clone().requires_grad_() for t in (F, C, z)]
        found = torch.autograd.grad(loss(*x), x, allow_unused=True)
        for k in range(3):
            if found[k] is None:
                assert loss is losses[0] and k == 1, "no gradient by argument {}".format(k)
                continue

            def moved(t):
                y = [F, C, z]
                y[k] = t
                return loss(*y)

            with torch.no_grad():
                d = difference(found[k], central_difference(moved, [F, C, z][k]))
            assert d <= 1e-6, "argument {}: {:.1e} of central differences".format(k, d)


def check_refusals(law, F, z):
    floats = "expected float32 or float64, found "
    for wrong, what in ((F.to(torch.int64), floats + "integers"),
                        (F.half(), floats + "floating-point numbers of 16"),
                        (F * float("nan"), "expected finite numbers, found NaN or infinity")):
        try:
            law.project(wrong, z)
        except (torch.jit.Error, AssertionError) as error:
            assert "uniphy law: F: " + what in str(error), str(error)
        else:
            raise AssertionError("not refused: " + what)


def check_eager(law, scripts, F, C, z):
    sys.path.insert(0, scripts)
    from isotropic import Isotropic
    from published import Published
    eager = {"isotropic": Isotropic, "published": Published}[law.form](law)
    assert torch.equal(eager.code_of("sand"), law.code_of("sand"))
    check_refusals(eager, F, z)
    for call in (lambda law, F: law.project(F, z), lambda law, F: law.stress(F, C, z)):
        answers = []
        for one in (law, eager):
            x = F.clone().requires_grad_()
            y = call(one, x)
            answers.append((y.detach(), torch.autograd.grad(y.square().sum(), x)[0]))
        for of_law, of_eager in zip(*answers):
            assert difference(of_eager, of_law) <= 1e-12, "eager: {} is not {}".format(
                of_eager, of_law)


def main():
    law = torch.jit.load(sys.argv[1])
    assert law.version == 3 and law.dtype == "float64"
    row = law.materials.index("sand")
    z = law.code_of("sand")
    assert torch.equal(z, law.codes[row]) and z.shape == (law.latent_size,)
    parameters = dict(zip(law.parameter_names, law.material_parameters[row].tolist()))
    assert parameters["theta"] == 0.5, parameters
    # A start for a fit: the code is the user's own, the file's stays.
    z = z.clone()

    generator = torch.Generator().manual_seed(3)
    C = 5 * torch.randn(1, 3, 3, generator=generator, dtype=torch.float64)
    rest = torch.eye(3, dtype=torch.float64)[None]
    apart = torch.diag(torch.tensor([1.25, 1.05, 0.8], dtype=torch.float64))[None]
    for F in (apart,) if law.form == "published" else (rest, 1.3 * rest, apart):
        check_gradients(law, F, C, z)
    x = rest.clone().requires_grad_()
    law.stress(law.project(x, z), C, z).sum().backward()
    assert bool(torch.isfinite(x.grad).all())
    check_refusals(law, rest, z)
    check_eager(law, sys.argv[2], torch.cat([apart, rest, -0.7 * apart]), C.repeat(3, 1, 1), z)
    print("{}, {}: torch {}".format(sys.argv[1], law.form, torch.__version__))


if __name__ == "__main__":
    main()
