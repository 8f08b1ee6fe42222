"""The isotropic form of an exported law; the formulas are explained in
ops/kernels/learned/isotropic_law.hpp, the divided differences in
ops/kernels/spectral/spectral.hpp and strain_measure.hpp.
"""

from typing import Tuple

import torch
from torch import Tensor

from law import Law


class Isotropic(Law):
    # U, sigma, V of F without gradient. The sign of det F goes to the last singular value: sigma
    # may be negative and U V^T is a rotation. Which of U and V holds a reflection makes no
    # difference to isotropic functions.
    def spectral(self, F: Tensor) -> Tuple[Tensor, Tensor, Tensor]:
        U, S, Vh = torch.linalg.svd(F.detach())
        mirror = 1.0 - 2.0 * torch.eye(3, dtype=F.dtype, device=F.device)[2]
        negative = torch.linalg.det(U) * torch.linalg.det(Vh) < 0.0
        sign = torch.where(negative.unsqueeze(1), mirror, torch.ones_like(mirror))
        return U, S * sign, (Vh * sign.unsqueeze(2)).transpose(1, 2)

    def invariants(self, sigma: Tensor, e: Tensor) -> Tuple[Tensor, Tensor, Tensor, Tensor]:
        eps = torch.log(torch.clamp(sigma, min=self.MINIMUM_STRETCH))
        t = eps.sum(1)
        w = (eps - (t / 3.0).unsqueeze(1)) / e.unsqueeze(1)
        root2 = (w * w).sum(1) + self.SMOOTHING * self.SMOOTHING
        return w, t / e, torch.sqrt(root2) - self.SMOOTHING, (w * w * w).sum(1) / root2

    def bounded(self, x: Tensor, limit: float) -> Tensor:
        return torch.clamp(x, min=-limit, max=limit)

    def sinh_of(self, x: Tensor) -> Tensor:
        return torch.sinh(self.bounded(x, self.SINH_LIMIT))

    # What stays of an excess x over a cap: kept_excess of ops/kernels/learned/return_caps.hpp. Its
    # share exp(w) solves log(e^w + A e^(p w)) = 0; the last step of Newton's method carries the
    # derivative.
    def kept_excess(self, x: Tensor, v: Tensor, factor: Tensor, p: Tensor) -> Tensor:
        powered = (v > self.TINY) & (x > self.TINY) & (p != 1.0)
        one = torch.ones_like(x)
        excess = torch.where(powered, x, one)
        flow = torch.where(powered, v, one)
        log_A = (p - 1.0) * (torch.log(excess / self.FLOW_EXCESS) + torch.log1p(flow)) + (
            torch.log(factor) - p * torch.log(flow))
        p0 = p.detach()
        w = torch.clamp(-log_A.detach() / p0, max=0.0)
        for step in range(8):
            a = torch.exp(w)
            b = torch.exp(p0 * w + log_A.detach())
            w = torch.clamp(w - torch.log(a + b) * (a + b) / (a + p0 * b), max=0.0)
        a = torch.exp(w)
        b = torch.exp(p0 * w + log_A.detach())
        total = torch.log(a + torch.exp(p * w + log_A))
        share = torch.exp(w - total * ((a + b) / (a + p0 * b)))
        linear = torch.clamp(v / factor, min=self.LEAST_VISCOSITY)
        return torch.where(powered, excess * share, x * linear / (1.0 + linear))

    # sinh(y)/y: below 1/2 by its series, whose terms reach 1e-16 there.
    def sinhc(self, y: Tensor) -> Tensor:
        small = torch.abs(y) < 0.5
        far = torch.where(small, torch.ones_like(y), y)
        y2 = torch.where(small, y * y, torch.zeros_like(y))
        near = 1.0 + y2 / 6.0 * (1.0 + y2 / 20.0 * (1.0 + y2 / 42.0 * (1.0 + y2 / 72.0 * (
            1.0 + y2 / 110.0 * (1.0 + y2 / 156.0 * (1.0 + y2 / 210.0))))))
        return torch.where(small, near, torch.sinh(far) / far)

    # The strain measure x exp(delta x) sinh(gamma x)/(gamma x).
    def measure(self, x: Tensor, gamma: Tensor, delta: Tensor) -> Tensor:
        y = torch.clamp(gamma * x, min=-self.ARGUMENT_LIMIT, max=self.ARGUMENT_LIMIT)
        d = torch.clamp(delta * x, min=-self.ARGUMENT_LIMIT, max=self.ARGUMENT_LIMIT)
        return x * torch.exp(d) * self.sinhc(y)

    # Of the pairs i < j, to rounding at any gap: (exp x_i - exp x_j)/(x_i - x_j).
    def exp_divided(self, x: Tensor) -> Tensor:
        d = self.left(x) - self.right(x)
        apart = d != 0.0
        one = torch.ones_like(d)
        d = torch.where(apart, d, one)
        return torch.exp(self.right(x)) * torch.where(apart, torch.expm1(d) / d, one)

    # (eps_i - eps_j)/(sigma_i - sigma_j), eps = log max(sigma, MINIMUM_STRETCH).
    def strain_divided(self, sigma: Tensor) -> Tensor:
        stretch = torch.clamp(sigma, min=self.MINIMUM_STRETCH)
        b = self.right(stretch)
        d = (self.left(stretch) - b) / b
        apart = d != 0.0
        one = torch.ones_like(d)
        d = torch.where(apart, d, one)
        of_stretch = torch.where(apart, torch.log1p(d) / d, one) / b
        # (stretch_i - stretch_j)/(sigma_i - sigma_j) is 1 above the clamp and 0 below it.
        gap = self.left(sigma) - self.right(sigma)
        apart = gap != 0.0
        ratio = (self.left(stretch) - b) / torch.where(apart, gap, one)
        clamped = self.right(sigma) < self.MINIMUM_STRETCH
        return of_stretch * torch.where(clamped, ratio, one)

    # M B of R(F) = U exp(y) V^T, y_i - y_j = scale (eps_i - eps_j), back in the frame of F.
    def turned(self, U: Tensor, sigma: Tensor, V: Tensor, scale: Tensor, y: Tensor,
               B: Tensor) -> Tensor:
        above = self.above(B)
        below = self.below(B)
        difference = self.exp_divided(y) * scale.unsqueeze(1) * self.strain_divided(sigma)
        stretch = torch.exp(y)
        quotient = (self.left(stretch) + self.right(stretch)) * self.inverse_sum(sigma)
        s = 0.5 * difference * (above + below)
        a = 0.5 * quotient * (above - below)
        M = self.beside_diagonal(s + a, s - a)
        return torch.matmul(U, torch.matmul(M, V.transpose(1, 2)))

    def project(self, F: Tensor, z: Tensor, dt: float = 2e-4) -> Tensor:
        self.check_step(dt)
        f = self.matrices("F", F, -1)
        rows = self.latent(z, f.size(0))
        U, sigma, V = self.spectral(f)
        B = torch.zeros_like(f)
        if self.differentiated(F):
            f = self.once(f)
            rows = self.once(rows)
            B = self.frame(f, U, V)
            sigma = sigma + torch.diagonal(B, 0, 1, 2)
        e = self.strain_scale(rows)
        w, t, q, cubic = self.invariants(sigma, e)
        code = rows.expand(f.size(0), rows.size(1))
        c = self.projection_network(torch.column_stack([t, q, cubic, code]))
        zero = torch.zeros([rows.size(0), 3], dtype=f.dtype, device=f.device)
        rest = self.projection_network(torch.hstack([zero, rows]))
        slope = self.sinh_of(c[:, 2])
        c1 = c[:, 0] + slope * t
        c2 = c[:, 1] - torch.clamp(rest[:, 1], max=0.0)
        norm2 = (w * w).sum(1)
        over = (torch.sqrt(norm2.detach()) > torch.clamp(c1, min=0.0)) | (c1 <= 0.0)
        over_t = t > c2
        one = torch.ones_like(t)
        stretch = torch.clamp(sigma, min=self.MINIMUM_STRETCH)
        viscosity = self.sinh_of(c[:, 3])
        factor = (stretch * stretch).mean(1) * (dt / self.FLOW_STEP)
        bound = self.FLOW_POWER_LIMIT
        # Without a yield surface the rate is linear: a power of the norm has no slope at rest.
        power = torch.where(c1 > 0.0, torch.exp(bound * torch.tanh(c[:, 4] / bound)), one)
        # The root has no slope at 0, and no say where nothing is cut.
        deviates = over & (norm2 > self.TINY)
        norm = torch.sqrt(torch.where(deviates, norm2, one))
        cap = torch.clamp(c1, min=0.0)
        excess = torch.where(deviates, norm - cap, torch.zeros_like(norm))
        cut = (cap + self.kept_excess(excess, viscosity, factor, power)) / norm
        linear = torch.clamp(viscosity / factor, min=self.LEAST_VISCOSITY)
        scale = torch.where(deviates, cut, linear / (1.0 + linear))
        scale = torch.where(over, scale, one)
        mean = (torch.where(over_t, c2, t) / 3.0).unsqueeze(1)
        y = (scale.unsqueeze(1) * w + mean) * e.unsqueeze(1)
        projected = torch.matmul(U * torch.exp(y).unsqueeze(1), V.transpose(1, 2))
        if self.differentiated(F):
            projected = projected + self.turned(U, sigma.detach(), V, scale.detach(), y.detach(),
                                                B)
        projected = torch.where((over | over_t).unsqueeze(1).unsqueeze(2), projected, f)
        fluid = (c1 < self.FLUID_CAP) & torch.logical_not(over_t)
        identity = torch.eye(3, dtype=f.dtype, device=f.device)
        ball = torch.exp(t * e / 3.0).unsqueeze(1).unsqueeze(2) * identity
        return torch.where(fluid.unsqueeze(1).unsqueeze(2), ball, projected).to(F.dtype)

    def stress(self, F_proj: Tensor, C: Tensor, z: Tensor) -> Tensor:
        f = self.matrices("F_proj", F_proj, -1)
        c = self.matrices("C", C, f.size(0))
        rows = self.latent(z, f.size(0))
        U, sigma, V = self.spectral(f)
        turn = torch.zeros_like(sigma)
        if self.differentiated(F_proj):
            c = self.once(c)
            rows = self.once(rows)
            B = self.frame(self.once(f), U, V)
            # d(U eps U^T) in the frame of U, beside its diagonal.
            turn = self.strain_divided(sigma) * self.inverse_sum(sigma) * (
                self.right(sigma) * self.above(B) + self.left(sigma) * self.below(B))
            sigma = sigma + torch.diagonal(B, 0, 1, 2)
        e = self.strain_scale(rows)
        w, t, q, cubic = self.invariants(sigma, e)
        D = (0.5 * self.TIME_SCALE) * (c + c.transpose(1, 2))
        D_trace = D[:, 0, 0] + D[:, 1, 1] + D[:, 2, 2]
        identity = torch.eye(3, dtype=f.dtype, device=f.device)
        D_dev = D - (D_trace / 3.0).unsqueeze(1).unsqueeze(2) * identity
        square = (D_dev * D_dev).sum([1, 2])
        n = torch.sqrt(square + self.SMOOTHING * self.SMOOTHING) - self.SMOOTHING
        turned_D = torch.matmul(D_dev, U)
        aligned = (w * (U * turned_D).sum(1)).sum(1)
        if self.differentiated(F_proj):
            D_frame = torch.matmul(U.transpose(1, 2), turned_D).detach()
            aligned = aligned + 2.0 / e.detach() * (turn * self.above(D_frame)).sum(1)
        x = aligned / (1.0 + n * q)
        code = rows.expand(f.size(0), rows.size(1))
        a = self.stress_network(torch.column_stack([t, q, cubic, D_trace, n, x, code]))
        zero = torch.zeros([rows.size(0), 6], dtype=f.dtype, device=f.device)
        rest = self.stress_network(torch.hstack([zero, rows]))
        b = self.sinh_of(a[:, 4])
        limit = self.EXPONENT_LIMIT
        volume = self.measure(t * e, self.bounded(a[:, 6], limit), self.bounded(a[:, 7], limit))
        pressure = self.sinh_of(a[:, 0]) * volume / e + (a[:, 1] - rest[:, 1]) + (
            (1.0 - a[:, 13]) * b * D_trace / 3.0)
        omega = self.bounded(a[:, 9:10], limit)
        eps = torch.log(torch.clamp(sigma, min=self.MINIMUM_STRETCH))
        eps = eps - omega * (t * e / 3.0).unsqueeze(1)
        half1 = 0.5 * self.bounded(a[:, 5:6], limit)
        half2 = 0.5 * self.bounded(a[:, 8:9], limit)
        a1 = (self.sinh_of(a[:, 2]) / e).unsqueeze(1)
        a2 = (self.sinh_of(a[:, 3]) / e).unsqueeze(1)
        M = self.measure(eps, half1, half1) * a1 + self.measure(eps, half2, half2) * a2
        d = pressure.unsqueeze(1) + M - omega * M.mean(1, keepdim=True)
        kappa = torch.exp(self.bounded(a[:, 11], self.RATE_SCALE_LIMIT))
        base = 1.0 + kappa * kappa * square
        rate_power = torch.exp(self.bounded(a[:, 12], self.RATE_EXPONENT_LIMIT) * torch.log(base))
        viscosity = b + self.sinh_of(a[:, 10]) * rate_power
        tau = torch.matmul(U * d.unsqueeze(1), U.transpose(1, 2))
        tau = tau + viscosity.unsqueeze(1).unsqueeze(2) * D_dev
        if self.differentiated(F_proj):
            # (d_i - d_j)/(eps_i - eps_j)
            bound = 2.0 * self.ARGUMENT_LIMIT
            x1 = self.bounded(2.0 * half1.detach() * eps.detach(), bound)
            x2 = self.bounded(2.0 * half2.detach() * eps.detach(), bound)
            slope = a1.detach() * self.exp_divided(x1) + a2.detach() * self.exp_divided(x2)
            slope = slope * turn
            beside = self.beside_diagonal(slope, slope)
            tau = tau + torch.matmul(U, torch.matmul(beside, U.transpose(1, 2)))
        return (self.stress_scale(rows).unsqueeze(1).unsqueeze(2) * tau).to(F_proj.dtype)
