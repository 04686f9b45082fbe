"""The tables of a recipe for the thesis's networks, their losses, and glare."""

from dataclasses import dataclass
from typing import Literal

from camkit.errors import ContractError
from camkit.models_def.networks.vgg import WIDTHS
from camkit.models_def.training.recipe import check_share

Optics = Literal["plate", "bare", "glare"]
MOST_ANGLE_DEG = 45.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisRecipe:
    """The settings of training of the thesis's networks.

    The thesis gives none of the weights; the exclusion loss counts in its fine-tuning only.

    Attributes:
        optics: What writes streaks: the plate, nothing but the bare lens, or a windshield.
        random_vgg: Whether VGG-19 may have random weights; to try the machinery, as features
            that were never trained are no perceptual loss.
        vgg_widths: Channels of the blocks of VGG-19 in the losses; others for tests.
        perceptual_weight: alpha_1 of eq. (5.9).
        exclusion_weight: alpha_2 of eq. (5.9).
        exclusion_from: Share of the schedule after which the exclusion loss counts.
        highlight_weight: beta of eq. (5.10).
        streak_weight: Of the perceptual loss on the streaks where the splitting network is
            trained alone; in the thesis the networks behind it teach them. 0 is eq. (5.9) alone.
    """

    optics: Optics = "plate"
    random_vgg: bool = False
    vgg_widths: tuple[int, ...] = WIDTHS
    perceptual_weight: float = 1.0
    exclusion_weight: float = 0.1
    exclusion_from: float = 0.7
    highlight_weight: float = 0.1
    streak_weight: float = 1.0

    def __post_init__(self) -> None:
        check_share("thesis.exclusion_from", self.exclusion_from)
        weights = (
            *(self.perceptual_weight, self.exclusion_weight),
            *(self.highlight_weight, self.streak_weight),
        )
        if min(weights) < 0:
            raise ContractError(f"the weights of thesis must be >= 0; got {weights}")
        if len(self.vgg_widths) != len(WIDTHS) or min(self.vgg_widths) < 1:
            raise ContractError(
                f"thesis.vgg_widths must be {len(WIDTHS)} positive integers; got {self.vgg_widths}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class GlareRecipe:
    """The two-point star of a windshield, see `star`. References: Sun 2021, section 5.7.1.

    Attributes:
        alpha: Of the light that goes straight on.
        beta: Of the arms, per pixel at their root.
        m: Decay of the arms per pixel.
        angle_min_deg: Least angle from the vertical, to either side.
        angle_max_deg: Greatest.
        reach_px: Where arms end.
    """

    alpha: float = 1.0
    beta: float = 0.00025
    m: float = 0.014
    angle_min_deg: float = 2.5
    angle_max_deg: float = 8.0
    reach_px: int = 240

    def __post_init__(self) -> None:
        if self.alpha <= 0 or self.beta <= 0 or self.m <= 0 or self.reach_px < 1:
            raise ContractError(
                "glare needs alpha, beta, m > 0 and reach_px >= 1; got "
                f"{self.alpha}, {self.beta}, {self.m}, {self.reach_px}"
            )
        if not 0 <= self.angle_min_deg <= self.angle_max_deg <= MOST_ANGLE_DEG:
            raise ContractError(
                f"glare.angle_min_deg <= angle_max_deg must lie in 0..{MOST_ANGLE_DEG:g}; got "
                f"{self.angle_min_deg:g}, {self.angle_max_deg:g}"
            )
