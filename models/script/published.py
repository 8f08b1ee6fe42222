"""The published form of an exported law; the formulas: ops/kernels/learned/published_law.hpp.

Its networks see U and V themselves, which jump where singular values meet (every frame of the
plane they share will do), so the law has no derivative there. What is answered is what the kernels
answer (svd3_adjoint in ops/kernels/spectral/svd3.hpp): 1/(sigma_j^2 - sigma_i^2) is replaced by
g/(g^2 + (f s)^2), g the gap of the squares, s the largest square and f = FACTOR_FLOOR (1e-6 in
float64, 1e-3 in float32). It is the derivative to (f s/g)^2 where singular values are apart; at
equal ones it is the derivative with U and V held.
"""

from typing import List, Tuple

import torch
from torch import Tensor

from law import Law


class Published(Law):
    # One-sided Jacobi, rotation by rotation that of the kernels (svd3.hpp), so that U and V agree
    # in the signs that the convention leaves open.
    def rotate(self, a: List[Tensor], v: List[Tensor], p: int, q: int) -> bool:
        alpha = (a[p] * a[p]).sum(1, keepdim=True)
        beta = (a[q] * a[q]).sum(1, keepdim=True)
        gamma = (a[p] * a[q]).sum(1, keepdim=True)
        least = self.EPSILON * self.EPSILON
        active = gamma * gamma > least * (4.0 * alpha * beta + least)
        if not bool(active.any()):
            return False
        zeta = (beta - alpha) / (2.0 * torch.where(active, gamma, torch.ones_like(gamma)))
        magnitude = 1.0 / (torch.abs(zeta) + torch.sqrt(zeta * zeta + 1.0))
        t = torch.where(zeta < 0.0, -magnitude, magnitude) * active
        c = 1.0 / torch.sqrt(t * t + 1.0)
        s = c * t
        ap = a[p]
        vp = v[p]
        a[p] = c * ap - s * a[q]
        a[q] = s * ap + c * a[q]
        v[p] = c * vp - s * v[q]
        v[q] = s * vp + c * v[q]
        return True

    def order(self, a: List[Tensor], v: List[Tensor], p: int, q: int) -> None:
        swap = (a[q] * a[q]).sum(1, keepdim=True) > (a[p] * a[p]).sum(1, keepdim=True)
        ap = a[p]
        vp = v[p]
        a[p] = torch.where(swap, a[q], ap)
        a[q] = torch.where(swap, -ap, a[q])
        v[p] = torch.where(swap, v[q], vp)
        v[q] = torch.where(swap, -vp, v[q])

    # U, sigma, V of F without gradient.
    def spectral(self, F: Tensor) -> Tuple[Tensor, Tensor, Tensor]:
        f = F.detach()
        scale = torch.amax(torch.abs(f), [1, 2], True)
        vanishing = scale < self.TINY * 16.0
        scale = torch.masked_fill(scale, vanishing, 1.0)
        m = f / scale
        a = [m[:, :, 0], m[:, :, 1], m[:, :, 2]]
        e = torch.eye(3, dtype=f.dtype, device=f.device).unsqueeze(0).expand(f.size(0), 3, 3)
        v = [e[:, 0], e[:, 1], e[:, 2]]
        for sweep in range(12):
            moved = self.rotate(a, v, 0, 1)
            moved = self.rotate(a, v, 0, 2) or moved
            moved = self.rotate(a, v, 1, 2) or moved
            if not moved:
                break
        self.order(a, v, 0, 1)
        self.order(a, v, 0, 2)
        self.order(a, v, 1, 2)
        s0 = torch.sqrt((a[0] * a[0]).sum(1, keepdim=True))
        u0 = torch.where(s0 > self.TINY, a[0] / torch.clamp(s0, min=self.TINY), e[:, 0])
        w = a[1] - (u0 * a[1]).sum(1, keepdim=True) * u0
        w2 = (w * w).sum(1, keepdim=True)
        x = u0[:, 0:1]
        zero = torch.zeros_like(x)
        other = torch.where(torch.abs(x) < 0.6, torch.hstack([zero, -u0[:, 2:3], u0[:, 1:2]]),
                            torch.hstack([-u0[:, 2:3], zero, x]))
        whole = (w2 > self.TINY) & (w2 > 0.25 * (a[1] * a[1]).sum(1, keepdim=True))
        w = torch.where(whole, w, other)
        u1 = w / torch.sqrt((w * w).sum(1, keepdim=True))
        u1 = u1 - (u0 * u1).sum(1, keepdim=True) * u0
        u1 = u1 / torch.sqrt((u1 * u1).sum(1, keepdim=True))
        u1 = torch.where((u1 * a[1]).sum(1, keepdim=True) < 0.0, -u1, u1)
        u2 = torch.linalg.cross(u0, u1)
        s1 = (u1 * a[1]).sum(1, keepdim=True)
        s2 = (u2 * a[2]).sum(1, keepdim=True)
        sigma = torch.masked_fill(torch.hstack([s0, s1, s2]) * scale[:, 0], vanishing[:, 0], 0.0)
        return torch.dstack([u0, u1, u2]), sigma, torch.dstack(v)

    def project(self, F: Tensor, z: Tensor, dt: float = 2e-4) -> Tensor:
        self.check_step(dt)
        f = self.matrices("F", F, -1)
        rows = self.latent(z, f.size(0))
        U, sigma, V = self.spectral(f)
        if self.differentiated(F):
            f = self.once(f)
            rows = self.once(rows)
            B = self.frame(f, U, V)
            si = self.left(sigma)
            sj = self.right(sigma)
            gap = (sj - si) * (sj + si)
            floor = self.FACTOR_FLOOR * torch.clamp(sigma[:, 0:1] * sigma[:, 0:1], min=1e-8)
            inverse = gap / (gap * gap + floor * floor)
            # dU = U of_U, dV = V of_V, both antisymmetric.
            of_U = (sj * self.above(B) + si * self.below(B)) * inverse
            of_V = (si * self.above(B) + sj * self.below(B)) * inverse
            U = U + torch.matmul(U, self.beside_diagonal(of_U, -of_U))
            V = V + torch.matmul(V, self.beside_diagonal(of_V, -of_V))
            sigma = sigma + torch.diagonal(B, 0, 1, 2)
        code = rows.expand(f.size(0), rows.size(1))
        e = self.strain_scale(rows).unsqueeze(1)
        rest = torch.eye(3, dtype=f.dtype, device=f.device).flatten().unsqueeze(0)
        features = torch.hstack([f.flatten(1) - rest, U.flatten(1) - rest, sigma - 1.0,
                                 V.transpose(1, 2).flatten(1) - rest]) / e
        change = self.projection_network(torch.hstack([features, code]))
        return (f + (self.DELTA_OVER_STRAIN * e * change).reshape(f.size())).to(F.dtype)

    def stress(self, F_proj: Tensor, C: Tensor, z: Tensor) -> Tensor:
        f = self.matrices("F_proj", F_proj, -1)
        c = self.matrices("C", C, f.size(0))
        rows = self.latent(z, f.size(0))
        U, sigma, V = self.spectral(f)
        R = torch.matmul(U, V.transpose(1, 2))
        if self.differentiated(F_proj):
            f = self.once(f)
            c = self.once(c)
            rows = self.once(rows)
            B = self.frame(f, U, V)
            # R = U 1 V^T: the divided difference is 0, the divided sum 2/(sigma_i + sigma_j).
            turn = (self.above(B) - self.below(B)) * self.inverse_sum(sigma)
            M = self.beside_diagonal(turn, -turn)
            R = R + torch.matmul(U, torch.matmul(M, V.transpose(1, 2)))
            sigma = sigma + torch.diagonal(B, 0, 1, 2)
        J = (torch.linalg.cross(f[:, 0], f[:, 1]) * f[:, 2]).sum(1, keepdim=True)
        F_max = torch.clamp(f[:, 0, 0:1], min=1e-6)
        rate = torch.matmul(R.transpose(1, 2), torch.matmul(c, R)) * self.TIME_SCALE
        rest = torch.eye(3, dtype=f.dtype, device=f.device).flatten().unsqueeze(0)
        right = torch.matmul(f.transpose(1, 2), f).flatten(1)
        features = torch.hstack([sigma - 1.0, right - rest, J - 1.0,
                                 torch.log(torch.clamp(J, min=1e-6)), F_max - 1.0,
                                 torch.log(F_max)]) / self.strain_scale(rows).unsqueeze(1)
        code = rows.expand(f.size(0), rows.size(1))
        S = self.stress_network(torch.hstack([features, rate.flatten(1), code])).reshape(f.size())
        tau = torch.matmul(R, torch.matmul(0.5 * (S + S.transpose(1, 2)), R.transpose(1, 2)))
        return (self.stress_scale(rows).unsqueeze(1).unsqueeze(2) * tau).to(F_proj.dtype)
