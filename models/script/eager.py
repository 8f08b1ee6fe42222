"""What the export writes anew for each law (models/torchscript_source.cpp): its numbers and its
networks, here for plain PyTorch, so that the methods of law.py, isotropic.py and published.py run
and can be checked without TorchScript.
"""

from typing import Any, List

import torch
from torch import Tensor


class Eager(torch.nn.Module):
    # Attributes of an exported law; their meaning: models/torchscript.hpp.
    activation: str
    latent_size: int
    codes: Tensor
    materials: List[str]
    projection_weight_0: Tensor
    # ops/kernels/learned/learned_law_weights.hpp has the values and the meaning of these.
    STRESS_SCALE: float
    STRESS_RATE: float
    STRAIN_SCALE: float
    STRAIN_RATE: float
    TIME_SCALE: float
    SMOOTHING: float
    SINH_LIMIT: float
    FLOW_STEP: float
    FLOW_EXCESS: float  # ops/kernels/learned/power_law.hpp
    LEAST_VISCOSITY: float
    FLOW_POWER_LIMIT: float
    EXPONENT_LIMIT: float
    RATE_SCALE_LIMIT: float
    RATE_EXPONENT_LIMIT: float
    FLUID_CAP: float
    ARGUMENT_LIMIT: float  # these three: ops/kernels/spectral/limits.hpp
    MINIMUM_STRETCH: float
    LEAST_SUM: float
    FACTOR_FLOOR: float  # ops/kernels/spectral/svd3.hpp, svd3_adjoint
    EPSILON: float  # of the law's dtype
    TINY: float  # its least normal number

    def __init__(self, exported: Any) -> None:
        """Takes the numbers of an exported law that torch.jit.load has read."""
        super().__init__()
        self.activation = exported.activation
        self.latent_size = exported.latent_size
        self.materials = exported.materials
        for name, value in exported.constants.items():
            setattr(self, name, value)
        for name, buffer in exported.named_buffers():
            self.register_buffer(name, buffer)

    def network(self, name: str, x: Tensor) -> Tensor:
        k = 0
        while True:
            weight = getattr(self, "{}_weight_{}".format(name, k))
            x = torch.nn.functional.linear(x, weight, getattr(self, "{}_bias_{}".format(name, k)))
            k += 1
            if not hasattr(self, "{}_weight_{}".format(name, k)):
                return x
            if self.activation == "gelu":
                x = torch.nn.functional.gelu(x)
            elif self.activation == "silu":
                x = torch.nn.functional.silu(x)
            else:
                x = 0.5 * (x + torch.sqrt(x * x + 4.0)) - 1.0

    def projection_network(self, x: Tensor) -> Tensor:
        return self.network("projection", x)

    def stress_network(self, x: Tensor) -> Tensor:
        return self.network("stress", x)
