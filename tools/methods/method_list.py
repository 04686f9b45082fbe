"""The methods that are trained for the front, and how each is fed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from torch import Tensor, nn

from camkit.models_def.networks.catalog import build_network
from camkit.models_def.networks.lean_unet import LeanConfig, LeanUnet
from camkit.models_def.sensors.wiener import taper_edges, to_otf
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.sample import Batch
from tools.methods.kernel_networks import Blurred, FeatureWiener, TwoStages, UnrolledHqs
from tools.methods.sample_store import KERNELS, NOISE

Feeding = Literal["bank", "capture", "kernels"]
"""Capture and bank, the capture alone, or the capture in blocks with their kernels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A method to train.

    Attributes:
        title: As charts and tables call it.
        build: Makes the untrained network.
        feeding: What it is given.
        learning_rate: At its peak.
        teacher: The method whose output it is fitted to as well, trained before it.
    """

    title: str
    build: Callable[[], nn.Module]
    feeding: Feeding
    learning_rate: float
    teacher: str | None = None


LEAN_XS: Final = LeanConfig(
    widths=(16, 16, 32), encoder_blocks=(0, 0), decoder_blocks=(0, 0), middle_blocks=3, bias=True
)
"""Half of S: 2.4 kMAC/px. No bundle holds it."""


def _of_catalog(name: str, **config: object) -> Callable[[], nn.Module]:
    return lambda: build_network(name, **config)


METHODS: Final[Mapping[str, Method]] = {
    "S": Method(
        title="S", build=_of_catalog("lean_s", bias=True), feeding="bank", learning_rate=2e-3
    ),
    "M": Method(
        title="M", build=_of_catalog("lean_m", bias=True), feeding="bank", learning_rate=2e-3
    ),
    "XS": Method(title="XS", build=lambda: LeanUnet(LEAN_XS), feeding="bank", learning_rate=2e-3),
    "XS_taught": Method(
        title="XS, taught by M",
        build=lambda: LeanUnet(LEAN_XS),
        feeding="bank",
        learning_rate=2e-3,
        teacher="M",
    ),
    "naf_bank": Method(
        title="NAFNet-16 behind the bank",
        build=_of_catalog("nafnet"),
        feeding="bank",
        learning_rate=1e-3,
    ),
    "naf_capture": Method(
        title="NAFNet-16 on the capture",
        build=_of_catalog("nafnet", in_channels=3),
        feeding="capture",
        learning_rate=1e-3,
    ),
    "unet_capture": Method(
        title="U-Net on the capture",
        build=_of_catalog("lean_m", bias=True, in_channels=3),
        feeding="capture",
        learning_rate=2e-3,
    ),
    "feature_wiener": Method(
        title="feature Wiener, U-Net",
        build=FeatureWiener,
        feeding="kernels",
        learning_rate=1e-3,
    ),
    "hqs": Method(
        title="HQS unrolled, 3 steps",
        build=UnrolledHqs,
        feeding="kernels",
        learning_rate=1e-3,
    ),
    "two_stages": Method(
        title="two stages of S, a closed form between",
        build=TwoStages,
        feeding="kernels",
        learning_rate=1e-3,
    ),
}


def run_blurred(fitter: Fitter, batch: Batch, progress: float, *, scale: float) -> Tensor:
    """Return what a network that knows the blur makes of the middles of blocks.

    Args:
        fitter: Of the network.
        batch: Of `SampleStore.draw_blocks`.
        progress: How much of the schedule lies behind.
        scale: Divisor of the stabilising transform.
    """
    blurred = blurred_blocks(batch, scale)
    with fitter.precision(progress):
        output: Tensor = fitter.network(blurred)
    margin = (output.shape[-1] - batch.target.shape[-1]) // 2
    return output.float()[..., margin:-margin, margin:-margin]


def blurred_blocks(batch: Batch, scale: float) -> Blurred:
    """Return the blocks of a batch as the bank sees them: linear, tapered, with their transfer."""
    stable, noise = batch.inputs["capture"], batch.masks[NOISE]
    size = (stable.shape[-2], stable.shape[-1])
    otf = to_otf(batch.masks[KERNELS], size)
    shot, read = noise[:, 0], noise[:, 1]
    electrons = (stable * scale).square()
    planes = shot[..., None, None] * electrons - (read / shot)[..., None, None]
    margin = (size[1] - batch.target.shape[-1]) // 2
    return Blurred(
        planes=taper_edges(planes, otf, margin // 2),
        otf=otf,
        shot=shot,
        read_variance=read,
        scale=scale,
    )
