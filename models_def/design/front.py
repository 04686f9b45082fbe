"""The front end between sensor and network.

None, the Wiener filter of every colour alone with the present kernels, or the bank of a camera
that ships, which restores the colours together (`camera`).
"""

from dataclasses import dataclass
from typing import Final, Literal, get_args

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.sensors.tone import encode_srgb
from camkit.models_def.sensors.wiener import to_otf

FrontName = Literal["none", "wiener", "together"]
_CORNER: Final = 1 / 512


@dataclass(frozen=True, slots=True, kw_only=True)
class Front:
    """The planes that a network sees, in sRGB tone.

    Attributes:
        kind: `none`: the network sees the capture (3 planes). `wiener`: the capture and what a
            Wiener filter restores of each colour (6). `together`: the developed capture and what
            the bank of a camera restores of it (6, stabilised); needs `[camera]`.
        signal_to_noise: Power of the signal at one cycle per pixel over that of the noise, for
            `wiener`. A high value punishes even blur.
        exponent: Exponent of the fall of the signal's power with the frequency, for `wiener`.
        filter_margin_px: Pixels recorded around a patch for the filter and cut off again; wide
            kernels need more.
        depth_known: The filter is that of the depth of the patch. If false, it is that of the
            mean kernel over all depths. Several configurations need true.
    """

    kind: FrontName = "none"
    signal_to_noise: float = 0.3
    exponent: float = 2.5
    filter_margin_px: int = 32
    depth_known: bool = True

    def __post_init__(self) -> None:
        if self.kind not in get_args(FrontName):
            raise ContractError(
                f"a front is one of {', '.join(get_args(FrontName))}; got {self.kind!r}"
            )
        if self.filter_margin_px < 1:
            raise ContractError(f"filter_margin_px must be >= 1; got {self.filter_margin_px}")
        if not self.signal_to_noise > 0:
            raise ContractError(f"signal_to_noise must be > 0; got {self.signal_to_noise}")

    @property
    def channels(self) -> int:
        """Return the number of planes."""
        return 3 if self.kind == "none" else 6

    @property
    def margin_px(self) -> int:
        """Return the margin that is recorded around a patch and cut off again."""
        return 0 if self.kind == "none" else self.filter_margin_px

    def planes(self, recorded: Tensor, kernels: Tensor) -> Tensor:
        """Return (b, channels, p, p) from (b, 3, p + 2 margin, ...) and kernels (b, 3, k, k)."""
        if self.kind == "none":
            return encode_srgb(recorded)
        inner = slice(self.filter_margin_px, -self.filter_margin_px)
        both = torch.cat([recorded, self._restore(recorded, kernels)], dim=1)
        return encode_srgb(both[..., inner, inner])

    def _restore(self, recorded: Tensor, kernels: Tensor) -> Tensor:
        size = recorded.shape[-2], recorded.shape[-1]
        fy = torch.fft.fftfreq(size[0])[:, None]
        fx = torch.fft.rfftfreq(size[1])[None]
        noise = (fy**2 + fx**2 + _CORNER**2) ** (self.exponent / 2) / self.signal_to_noise
        otf = to_otf(kernels.to(recorded.dtype), size)
        gain = otf.conj() / (otf.real.square() + otf.imag.square() + noise)
        level = recorded.mean((-2, -1), keepdim=True)
        restored: Tensor = torch.fft.irfft2(torch.fft.rfft2(recorded - level) * gain, s=size)
        return restored + level
