#include "models/torchscript_source.hpp"

#include <cstdio>
#include <limits>

#include "ops/kernels/spectral/limits.hpp"

namespace uniphy::models {

using kernels::Activation;
using kernels::LawForm;

namespace {

std::string literal(double x) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17e", x);
  return text;
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += with.size())
    text.replace(at, what.size(), with);
  return text;
}

/// def NAME_network(self, x): the layers one after the other.
std::string network(const std::string& name, std::size_t depth, Activation activation) {
  std::string text = "def " + name + "_network(self, x: Tensor) -> Tensor:\n";
  for (std::size_t k = 0; k < depth; ++k) {
    const std::string n = std::to_string(k);
    text += "    x = torch.linear(x, self." + name + "_weight_" + n + ", self." + name + "_bias_" +
            n + ")\n";
    if (k + 1 == depth) break;
    if (activation == Activation::gelu)
      text += "    x = torch.gelu(x)\n";
    else if (activation == Activation::silu)
      text += "    x = torch.silu(x)\n";
    else
      text += "    x = 0.5 * (x + torch.sqrt(x * x + 4.0)) - 1.0\n";
  }
  return text + "    return x\n\n";
}

// Columns are joined by hstack, column_stack and dstack, never by cat or stack: the fuser of
// LibTorch 2 with LLVM (Debian 13's) joins a cat with what comes before and after it, and then
// compiles for minutes.

/// Checks of the arguments, and the latent as rows [1 or P, Z].
const char* const kCommon = R"(
def matrices(self, name: str, m: Tensor, count: int) -> Tensor:
    assert m.dim() == 3 and m.size(1) == 3 and m.size(2) == 3 and (count < 0 or m.size(0) == count), "uniphy law: {}: expected [{}, 3, 3], found {}".format(name, "P" if count < 0 else str(count), m.size())
    return m.to(self.projection_weight_0.dtype)

def latent(self, z: Tensor, count: int) -> Tensor:
    assert (z.dim() == 1 or z.dim() == 2) and z.size(-1) == self.latent_size and (z.dim() == 1 or z.size(0) == count), "uniphy law: z: expected [{}] or [{}, {}], found {}".format(self.latent_size, count, self.latent_size, z.size())
    rows = z.to(self.projection_weight_0.dtype)
    if rows.dim() == 1:
        rows = rows.unsqueeze(0)
    return rows

def stress_scale(self, z: Tensor) -> Tensor:
    return STRESS_SCALE

def strain_scale(self, z: Tensor) -> Tensor:
    return STRAIN_SCALE

)";

const char* const kIsotropic = R"(
def spectral(self, F: Tensor) -> Tuple[Tensor, Tensor, Tensor]:
    U, S, Vh = torch.linalg_svd(F)
    # The sign of det F goes to the last singular value: sigma may be negative and U V^T is a
    # rotation. Which of U and V holds a reflection makes no difference to isotropic functions.
    mirror = 1.0 - 2.0 * torch.eye(3, dtype=F.dtype, device=F.device)[2]
    negative = torch.linalg_det(U) * torch.linalg_det(Vh) < 0.0
    sign = torch.where(negative.unsqueeze(1), mirror, torch.ones_like(mirror))
    return U, S * sign, Vh * sign.unsqueeze(2)

def invariants(self, sigma: Tensor, e: Tensor) -> Tuple[Tensor, Tensor, Tensor, Tensor]:
    eps = torch.log(torch.clamp(sigma, min=MINIMUM_STRETCH))
    t = eps.sum(1)
    w = (eps - (t / 3.0).unsqueeze(1)) / e.unsqueeze(1)
    root2 = (w * w).sum(1) + SMOOTHING * SMOOTHING
    return w, t / e, torch.sqrt(root2) - SMOOTHING, (w * w * w).sum(1) / root2

def sinh_of(self, x: Tensor) -> Tensor:
    return torch.sinh(torch.clamp(x, min=-SINH_LIMIT, max=SINH_LIMIT))

def exponent_of(self, x: Tensor) -> Tensor:
    return torch.clamp(x, min=-EXPONENT_LIMIT, max=EXPONENT_LIMIT)

# x exp(delta x) sinh(gamma x)/(gamma x)
def measure(self, x: Tensor, gamma: Tensor, delta: Tensor) -> Tensor:
    y = torch.clamp(gamma * x, min=-ARGUMENT_LIMIT, max=ARGUMENT_LIMIT)
    small = torch.abs(y) < 1e-2
    far = torch.where(small, torch.ones_like(y), y)
    y2 = y * y
    near = 1.0 + y2 / 6.0 * (1.0 + y2 / 20.0 * (1.0 + y2 / 42.0 * (1.0 + y2 / 72.0)))
    ratio = torch.where(small, near, torch.sinh(far) / far)
    return x * torch.exp(torch.clamp(delta * x, min=-ARGUMENT_LIMIT, max=ARGUMENT_LIMIT)) * ratio

def project(self, F: Tensor, z: Tensor) -> Tensor:
    f = self.matrices("F", F, -1)
    rows = self.latent(z, f.size(0))
    e = self.strain_scale(rows)
    U, sigma, Vt = self.spectral(f)
    w, t, q, cubic = self.invariants(sigma, e)
    code = rows.expand(f.size(0), rows.size(1))
    c = self.projection_network(torch.column_stack([t, q, cubic, code]))
    zero = torch.zeros([rows.size(0), 3], dtype=f.dtype, device=f.device)
    rest = self.projection_network(torch.hstack([zero, rows]))
    slope = self.sinh_of(c[:, 2])
    c1 = c[:, 0] + slope * t
    c2 = c[:, 1] - torch.clamp(rest[:, 1], max=0.0)
    norm = torch.sqrt((w * w).sum(1))
    over = (norm > torch.clamp(c1, min=0.0)) | (c1 <= 0.0)
    over_t = t > c2
    one = torch.ones_like(norm)
    stretch = torch.clamp(sigma, min=MINIMUM_STRETCH)
    share = 1.0 / (1.0 + torch.clamp(self.sinh_of(c[:, 3]) / (stretch * stretch).mean(1), min=LEAST_VISCOSITY))
    ratio = torch.clamp(c1, min=0.0) / torch.where(norm > 0.0, norm, one)
    scale = torch.where(over, 1.0 - share + share * ratio, one)
    y = (scale.unsqueeze(1) * w + (torch.where(over_t, c2, t) / 3.0).unsqueeze(1)) * e.unsqueeze(1)
    projected = torch.matmul(U * torch.exp(y).unsqueeze(1), Vt)
    projected = torch.where((over | over_t).unsqueeze(1).unsqueeze(2), projected, f)
    fluid = (c1 < FLUID_CAP) & torch.logical_not(over_t)
    ball = torch.exp(t * e / 3.0).unsqueeze(1).unsqueeze(2) * torch.eye(3, dtype=f.dtype, device=f.device)
    return torch.where(fluid.unsqueeze(1).unsqueeze(2), ball, projected).to(F.dtype)

def stress(self, F_proj: Tensor, C: Tensor, z: Tensor) -> Tensor:
    f = self.matrices("F_proj", F_proj, -1)
    c = self.matrices("C", C, f.size(0))
    rows = self.latent(z, f.size(0))
    U, sigma, Vt = self.spectral(f)
    w, t, q, cubic = self.invariants(sigma, self.strain_scale(rows))
    D = (0.5 * TIME_SCALE) * (c + c.transpose(1, 2))
    D_trace = D[:, 0, 0] + D[:, 1, 1] + D[:, 2, 2]
    D_dev = D - (D_trace / 3.0).unsqueeze(1).unsqueeze(2) * torch.eye(3, dtype=f.dtype, device=f.device)
    n = torch.sqrt((D_dev * D_dev).sum([1, 2]) + SMOOTHING * SMOOTHING) - SMOOTHING
    x = (w * (U * torch.matmul(D_dev, U)).sum(1)).sum(1) / (1.0 + n * q)
    code = rows.expand(f.size(0), rows.size(1))
    a = self.stress_network(torch.column_stack([t, q, cubic, D_trace, n, x, code]))
    zero = torch.zeros([rows.size(0), 6], dtype=f.dtype, device=f.device)
    rest = self.stress_network(torch.hstack([zero, rows]))
    e = self.strain_scale(rows)
    b = self.sinh_of(a[:, 4])
    volume = self.measure(t * e, self.exponent_of(a[:, 6]), self.exponent_of(a[:, 7]))
    pressure = self.sinh_of(a[:, 0]) * volume / e + (a[:, 1] - rest[:, 1]) + b * D_trace / 3.0
    half = (0.5 * self.exponent_of(a[:, 5])).unsqueeze(1)
    eps = torch.log(torch.clamp(sigma, min=MINIMUM_STRETCH))
    strain = self.measure(eps, half, half) * (self.sinh_of(a[:, 2]) / e).unsqueeze(1)
    w2 = w * w
    second = (w2 - w2.mean(1, keepdim=True)) / (1.0 + q).unsqueeze(1)
    d = pressure.unsqueeze(1) + strain + a[:, 3:4] * second
    tau = torch.matmul(U * d.unsqueeze(1), U.transpose(1, 2)) + b.unsqueeze(1).unsqueeze(2) * D_dev
    return (self.stress_scale(rows).unsqueeze(1).unsqueeze(2) * tau).to(F_proj.dtype)
)";

// One-sided Jacobi, rotation by rotation that of the kernels, so that U and V agree in the signs
// that the convention leaves open: the networks see U and V themselves.
const char* const kPublished = R"(
def rotate(self, a: List[Tensor], v: List[Tensor], p: int, q: int) -> bool:
    alpha = (a[p] * a[p]).sum(1, keepdim=True)
    beta = (a[q] * a[q]).sum(1, keepdim=True)
    gamma = (a[p] * a[q]).sum(1, keepdim=True)
    active = gamma * gamma > EPSILON2 * (4.0 * alpha * beta + EPSILON2)
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

def signed_svd(self, F: Tensor) -> Tuple[Tensor, Tensor, Tensor]:
    scale = torch.amax(torch.abs(F), [1, 2], True)
    vanishing = scale < TINY * 16.0
    scale = torch.masked_fill(scale, vanishing, 1.0)
    m = F / scale
    a = [m[:, :, 0], m[:, :, 1], m[:, :, 2]]
    e = torch.eye(3, dtype=F.dtype, device=F.device).unsqueeze(0).expand(F.size(0), 3, 3)
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
    u0 = torch.where(s0 > TINY, a[0] / torch.clamp(s0, min=TINY), e[:, 0])
    w = a[1] - (u0 * a[1]).sum(1, keepdim=True) * u0
    w2 = (w * w).sum(1, keepdim=True)
    x = u0[:, 0:1]
    zero = torch.zeros_like(x)
    other = torch.where(torch.abs(x) < 0.6, torch.hstack([zero, -u0[:, 2:3], u0[:, 1:2]]), torch.hstack([-u0[:, 2:3], zero, x]))
    w = torch.where((w2 > TINY) & (w2 > 0.25 * (a[1] * a[1]).sum(1, keepdim=True)), w, other)
    u1 = w / torch.sqrt((w * w).sum(1, keepdim=True))
    u1 = u1 - (u0 * u1).sum(1, keepdim=True) * u0
    u1 = u1 / torch.sqrt((u1 * u1).sum(1, keepdim=True))
    u1 = torch.where((u1 * a[1]).sum(1, keepdim=True) < 0.0, -u1, u1)
    u2 = torch.linalg_cross(u0, u1)
    s1 = (u1 * a[1]).sum(1, keepdim=True)
    s2 = (u2 * a[2]).sum(1, keepdim=True)
    sigma = torch.masked_fill(torch.hstack([s0, s1, s2]) * scale[:, 0], vanishing[:, 0], 0.0)
    return torch.dstack([u0, u1, u2]), sigma, torch.dstack(v)

def project(self, F: Tensor, z: Tensor) -> Tensor:
    f = self.matrices("F", F, -1)
    rows = self.latent(z, f.size(0))
    U, sigma, V = self.signed_svd(f)
    code = rows.expand(f.size(0), rows.size(1))
    features = [f.flatten(1), U.flatten(1), sigma, V.transpose(1, 2).flatten(1), code]
    return (f + self.projection_network(torch.hstack(features)).reshape(f.size())).to(F.dtype)

def stress(self, F_proj: Tensor, C: Tensor, z: Tensor) -> Tensor:
    f = self.matrices("F_proj", F_proj, -1)
    c = self.matrices("C", C, f.size(0))
    rows = self.latent(z, f.size(0))
    U, sigma, V = self.signed_svd(f)
    R = torch.matmul(U, V.transpose(1, 2))
    J = (torch.linalg_cross(f[:, 0], f[:, 1]) * f[:, 2]).sum(1, keepdim=True)
    F_max = torch.clamp(f[:, 0, 0:1], min=1e-6)
    rate = torch.matmul(R.transpose(1, 2), torch.matmul(c, R)) * TIME_SCALE
    features = [sigma, torch.matmul(f.transpose(1, 2), f).flatten(1), J, torch.log(torch.clamp(J, min=1e-6)), F_max, torch.log(F_max), rate.flatten(1), rows.expand(f.size(0), rows.size(1))]
    S = self.stress_network(torch.hstack(features)).reshape(f.size())
    tau = torch.matmul(R, torch.matmul(0.5 * (S + S.transpose(1, 2)), R.transpose(1, 2)))
    return (self.stress_scale(rows).unsqueeze(1).unsqueeze(2) * tau).to(F_proj.dtype)
)";

}  // namespace

std::string script_source(const kernels::LearnedLawWeights& weights, bool single_precision) {
  const auto scale = [&weights](int coordinate, double factor, double rate) {
    const std::string n = std::to_string(coordinate);
    if (weights.latent_size <= coordinate)
      return "torch.full([1], " + literal(factor) + ", dtype=z.dtype, device=z.device)";
    return literal(factor) + " * torch.exp(" + literal(rate) + " * z[:, " + n + "])";
  };
  const double epsilon = single_precision ? double(std::numeric_limits<float>::epsilon())
                                          : std::numeric_limits<double>::epsilon();
  const double tiny = single_precision ? double(std::numeric_limits<float>::min())
                                       : std::numeric_limits<double>::min();
  std::string text = kCommon;
  text += network("projection", weights.projection.layers.size(), weights.activation);
  text += network("stress", weights.stress.layers.size(), weights.activation);
  text += weights.form == LawForm::isotropic ? kIsotropic : kPublished;
  text = replaced(text, "STRESS_SCALE", scale(0, kernels::kStressScale, kernels::kStressRate));
  text = replaced(text, "STRAIN_SCALE", scale(1, kernels::kStrainScale, kernels::kStrainRate));
  text = replaced(text, "TIME_SCALE", literal(kernels::kTimeScale));
  text = replaced(text, "MINIMUM_STRETCH", literal(kernels::kMinimumStretch));
  text = replaced(text, "SMOOTHING", literal(kernels::kInvariantSmoothing));
  text = replaced(text, "LEAST_VISCOSITY", literal(kernels::kLeastViscosity));
  text = replaced(text, "SINH_LIMIT", literal(kernels::kSinhLimit));
  text = replaced(text, "EXPONENT_LIMIT", literal(kernels::kExponentLimit));
  text = replaced(text, "ARGUMENT_LIMIT", literal(kernels::kArgumentLimit));
  text = replaced(text, "FLUID_CAP", literal(kernels::kFluidCap));
  text = replaced(text, "EPSILON2", literal(epsilon * epsilon));
  return replaced(text, "TINY", literal(tiny));
}

}  // namespace uniphy::models
