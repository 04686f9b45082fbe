"""The three networks in a row. References: Sun 2021, eqs. (5.3) to (5.5) and figure 5.2."""

from dataclasses import dataclass
from typing import Final

from torch import Tensor, nn

from camkit.models_def.kinds.hdr.thesis.fusion import FusionConfig, FusionNetwork
from camkit.models_def.kinds.hdr.thesis.highlight import HighlightConfig, HighlightUnet
from camkit.models_def.kinds.hdr.thesis.splitting import SplittingConfig, SplittingNetwork

SATURATED: Final = 0.99
"""From where a capture counts as saturated; the thesis gives no level."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainOutput:
    """The outputs of the networks; each (b, 3, h, w) linear.

    Attributes:
        clean: I_U, 0..1.
        streaks: I_r, 0..2^4.
        lights: I_S before it is masked, 1..2^8.
        fused: I_F, 0..2^8.
    """

    clean: Tensor
    streaks: Tensor
    lights: Tensor
    fused: Tensor


class ThesisChain(nn.Module):
    """Splitting, highlight and fusion network."""

    def __init__(
        self,
        splitting: SplittingConfig | None = None,
        highlight: HighlightConfig | None = None,
        fusion: FusionConfig | None = None,
    ) -> None:
        super().__init__()
        self.splitting = SplittingNetwork(splitting)
        self.highlight = HighlightUnet(highlight)
        self.fusion = FusionNetwork(fusion)
        self.stride_px = max(self.splitting.stride_px, self.highlight.stride_px)

    def outputs(self, capture: Tensor) -> ChainOutput:
        """Return all that is between, and the result, from (b, 3, h, w) linear."""
        clean, streaks = self.splitting(capture)
        lights = self.highlight(streaks)
        fused = self.fusion(clean, lights * saturated(capture))
        return ChainOutput(clean=clean, streaks=streaks, lights=lights, fused=fused)

    def forward(self, capture: Tensor) -> Tensor:
        """Return (b, 3, h, w) linear, 0..2^8, from a capture, 1 = white."""
        return self.outputs(capture).fused


def saturated(capture: Tensor) -> Tensor:
    """Return (b, 1, h, w): 1 where any colour is saturated, else 0."""
    return (capture.amax(dim=1, keepdim=True) >= SATURATED).to(capture.dtype)
