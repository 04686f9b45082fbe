"""Networks of single-photon cameras by name, alone or trained with the plate before them."""

from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import NOISE_DEVIATIONS
from camkit.models_def.kinds.spad.plate_psf import SoftmaxPsf
from camkit.models_def.kinds.spad.sampling import GAUSSIAN_SIGMA, see_through
from camkit.models_def.networks.back_projection import BackProjection, BackProjectionConfig
from camkit.models_def.networks.bicubic import PHASE, SCALE
from camkit.models_def.networks.bicubic_first import Srcnn, SrcnnConfig, Vdsr, VdsrConfig
from camkit.models_def.networks.catalog import Builders, build_one, changed, configured
from camkit.models_def.networks.sub_pixel import SUB_PIXEL_M, SUB_PIXEL_S, SubPixel

JOINT: Final = "joint_"


class JointCamera(nn.Module):
    """A plate and the network that reads through it, trained together (eq. 4.1).

    Its planes are the sharp picture and, in every sub-pixel, 1 / sqrt(N), N the photons of white.
    """

    def __init__(
        self, network: nn.Module, *, sigma: float = GAUSSIAN_SIGMA, phase: int = PHASE
    ) -> None:
        super().__init__()
        self.stride_px = SCALE
        self.in_channels = 2
        self.phase = phase
        self.plate = SoftmaxPsf(sigma)
        self.network = network

    def see(self, sharp: Tensor) -> Tensor:
        """Return the light of the pixels (b, 1, h, w) from (b, 1, 4 h, 4 w), in float32."""
        return see_through(sharp.float(), self.plate(), self.phase)

    def read(self, light: Tensor, deviation: Tensor) -> Tensor:
        """Return the picture from counted light (b, 1, h, w) and 1 / sqrt(N) (b, 1, 1, 1)."""
        noise = NOISE_DEVIATIONS * deviation * torch.sqrt(light.clamp(min=0) + deviation.square())
        return torch.as_tensor(self.network(torch.cat([light, noise], dim=1)))

    def forward(self, planes: Tensor) -> Tensor:
        """Return the picture (b, 1, 4 h, 4 w) that light without noise would make."""
        return self.read(self.see(planes[:, :1]), planes[:, 1:, :1, :1])


_BUILDERS: Final[Builders] = {
    "sub_pixel_s": changed(SubPixel, SUB_PIXEL_S),
    "sub_pixel_m": changed(SubPixel, SUB_PIXEL_M),
    "d_dbpn": configured(BackProjection, BackProjectionConfig),
    "srcnn": configured(Srcnn, SrcnnConfig),
    "vdsr": configured(Vdsr, VdsrConfig),
}
NETWORK_NAMES: Final = (*_BUILDERS, *(f"{JOINT}{name}" for name in _BUILDERS))


def build_spad_network(name: str, **config: Any) -> nn.Module:
    """Build an untrained network.

    Args:
        name: One of `NETWORK_NAMES`; with `joint_` before it, with a plate of its own.
        config: Fields of its config that differ from the defaults, as a recipe has them (lists are
            taken for tuples); of a joint one `sigma` too, of the Gaussian that its plate begins as.

    Raises:
        ContractError: If the name or a field is unknown, or a value out of range.
    """
    if name not in NETWORK_NAMES:
        raise ContractError(f"network must be one of {', '.join(NETWORK_NAMES)}; got {name!r}")
    if not name.startswith(JOINT):
        return build_one(_BUILDERS, name, config)
    fields: dict[str, Any] = {"in_channels": 2} | config
    sigma = float(fields.pop("sigma", GAUSSIAN_SIGMA))
    network = build_one(_BUILDERS, name.removeprefix(JOINT), fields)
    return JointCamera(network, sigma=sigma, phase=int(fields.get("phase", PHASE)))
