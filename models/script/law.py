"""What both forms of an exported law share: the checks of the arguments, the scales of z, the
derivative by F. The export takes the methods of the class as they stand, in the language of
TorchScript, with self.CONSTANT written out (models/torchscript_source.cpp).

How a law is differentiated by F. Its spectral factors F = U diag(sigma) V^T have no derivative
where singular values meet, as they do at rest; the law itself has one. So the factors are computed
of F0 = F without gradient, and with
    B = U^T (F - F0) V,
which is zero and whose derivative by F is not, the answer is U (r(sigma + diag B) + M B) V^T, M
the divided differences of ops/kernels/spectral/spectral.hpp: P(F0) + dP(F0)[F - F0], which has the
value and the first derivative of P. A second derivative would be that of this line and not of P.
It is refused: F goes through cdist, which PyTorch cannot differentiate twice.

Columns are joined by hstack, column_stack and dstack, never by cat or stack: the fuser of
LibTorch 2 with LLVM (Debian 13's) joins a cat with what comes before and after it, and then
compiles for minutes.
"""

from typing import List

import torch
from torch import Tensor

from eager import Eager


class Law(Eager):
    def kind(self, x: Tensor) -> str:
        bits = "{} bits".format(8 * x.element_size())
        if x.is_complex():
            return "complex numbers of " + bits
        if x.is_floating_point():
            return "floating-point numbers of " + bits
        return "integers or truth values of " + bits

    def numbers(self, name: str, x: Tensor) -> Tensor:
        assert x.is_floating_point() and x.element_size() >= 4, (
            "uniphy law: {}: expected float32 or float64, found {}".format(name, self.kind(x)))
        number = x.to(self.projection_weight_0.dtype)
        assert bool(torch.isfinite(number).all()), (
            "uniphy law: {}: expected finite numbers, found NaN or infinity".format(name))
        return number

    def matrices(self, name: str, m: Tensor, count: int) -> Tensor:
        assert m.dim() == 3 and m.size(1) == 3 and m.size(2) == 3 and (
            count < 0 or m.size(0) == count), (
                "uniphy law: {}: expected [{}, 3, 3], found {}".format(
                    name, "P" if count < 0 else str(count), m.size()))
        return self.numbers(name, m)

    # z as rows [1 or P, Z].
    def latent(self, z: Tensor, count: int) -> Tensor:
        assert (z.dim() == 1 or z.dim() == 2) and z.size(-1) == self.latent_size and (
            z.dim() == 1 or z.size(0) == count), (
                "uniphy law: z: expected [{}] or [{}, {}], found {}".format(
                    self.latent_size, count, self.latent_size, z.size()))
        rows = self.numbers("z", z)
        if rows.dim() == 1:
            rows = rows.unsqueeze(0)
        return rows

    # The default of project's dt is FLOW_STEP, kFlowStep of ops/kernels/learned.
    def check_step(self, dt: float) -> None:
        assert dt > 0.0 and dt < float("inf"), (
            "uniphy law: dt: expected a time step above 0 s, found {}".format(dt))

    # The code of the first training trajectory of a material, [Z].
    def code_of(self, material: str) -> Tensor:
        row = 0
        while row < len(self.materials) and self.materials[row] != material:
            row += 1
        if row == len(self.materials):
            known: List[str] = []
            for name in self.materials:
                if name not in known:
                    known.append(name)
            assert False, "uniphy law: material: expected one of {}, found {}".format(
                ", ".join(known), material)
        return self.codes[row]

    def stress_scale(self, z: Tensor) -> Tensor:
        if self.latent_size < 1:
            return torch.full([1], self.STRESS_SCALE, dtype=z.dtype, device=z.device)
        return self.STRESS_SCALE * torch.exp(self.STRESS_RATE * z[:, 0])

    def strain_scale(self, z: Tensor) -> Tensor:
        if self.latent_size < 2:
            return torch.full([1], self.STRAIN_SCALE, dtype=z.dtype, device=z.device)
        return self.STRAIN_SCALE * torch.exp(self.STRAIN_RATE * z[:, 1])

    def differentiated(self, F: Tensor) -> bool:
        return torch.is_grad_enabled() and F.requires_grad

    # x to the bit, to be differentiated once: |1 + (x - x0)| - 1 is x - x0 at x = x0.
    def once(self, x: Tensor) -> Tensor:
        x0 = x.detach()
        origin = torch.zeros([1, 1], dtype=x.dtype, device=x.device)
        one = torch.cdist((x - x0 + 1.0).reshape(-1, 1), origin, 1.0)
        return x0 - (1.0 - one.reshape(x.size()))

    # B = U^T (F - F0) V.
    def frame(self, F: Tensor, U: Tensor, V: Tensor) -> Tensor:
        return torch.matmul(U.transpose(1, 2), torch.matmul(F - F.detach(), V))

    # Of x_i and B_ij the pairs i < j: (0, 1), (0, 2), (1, 2).
    def left(self, x: Tensor) -> Tensor:
        return torch.hstack([x[:, 0:1], x[:, 0:1], x[:, 1:2]])

    def right(self, x: Tensor) -> Tensor:
        return torch.hstack([x[:, 1:2], x[:, 2:3], x[:, 2:3]])

    def above(self, B: Tensor) -> Tensor:
        return torch.hstack([B[:, 0, 1:3], B[:, 1, 2:3]])

    def below(self, B: Tensor) -> Tensor:
        return torch.hstack([B[:, 1:3, 0], B[:, 2:3, 1]])

    # The matrix with these above and below its diagonal of zeros.
    def beside_diagonal(self, above: Tensor, below: Tensor) -> Tensor:
        zero = torch.zeros_like(above[:, 0:1])
        rows = torch.hstack([zero, above[:, 0:2], below[:, 0:1], zero, above[:, 2:3],
                             below[:, 1:3], zero])
        return rows.reshape(above.size(0), 3, 3)

    # 1/(sigma_i + sigma_j), the sum bounded away from zero (inverse_sum, spectral.hpp).
    def inverse_sum(self, sigma: Tensor) -> Tensor:
        total = self.left(sigma) + self.right(sigma)
        magnitude = torch.clamp(torch.abs(total), min=self.LEAST_SUM)
        return 1.0 / torch.where(total < 0.0, -magnitude, magnitude)
