"""The schedule of a joint design: steps, rates, and when the lens rests."""

from dataclasses import dataclass

from camkit.errors import ContractError
from camkit.models_def.toml_table import check_least


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignSchedule:
    """The schedule of a design.

    Attributes:
        steps: Number of steps; at least 1.
        batch: Patches of a step; at least 1.
        patch_px: Side of a patch after blur and margins; a multiple of the network's stride.
        lens_rate: Learning rate of the lens, at least 0; 0 trains the network alone.
        network_rate: Learning rate of the network; at least 0.
        epoch_steps: Steps after which both rates are multiplied by `decay`; at least 1.
        decay: Factor of both rates after every `epoch_steps`; more than 0, at most 1.
        hold_steps: First steps in which the lens stays, until the network follows; at least 0.
            Without a network the lens moves at once.
        freeze_share: Last share of the steps in which the lens stays, 0 to 1.
        penalty_weight: Weight of `[limits]` in the loss, and in dB in the choice of the best lens.
        valid_steps: Steps between validations, at least 1; the last step has one too.
        valid_patches: Fixed patches of a validation; at least 1.
        seed: Random seed of weights and samples.
    """

    steps: int = 2000
    batch: int = 8
    patch_px: int = 128
    lens_rate: float = 0.02
    network_rate: float = 8e-4
    epoch_steps: int = 200
    decay: float = 0.8
    hold_steps: int = 100
    freeze_share: float = 0.25
    penalty_weight: float = 10.0
    valid_steps: int = 100
    valid_patches: int = 24
    seed: int = 1

    def __post_init__(self) -> None:
        positive = ("steps", "batch", "patch_px", "epoch_steps", "valid_steps", "valid_patches")
        check_least(self, 1, *positive)
        check_least(self, 0, "hold_steps", "lens_rate", "network_rate")
        if not 0 <= self.freeze_share <= 1:
            raise ContractError(f"freeze_share must lie in 0..1; got {self.freeze_share}")
        if not 0 < self.decay <= 1:
            raise ContractError(f"decay must be more than 0, at most 1; got {self.decay}")

    def moves_lens(self, step: int, *, has_network: bool) -> bool:
        """Return whether the lens moves in a step: it waits for a network, and rests at last."""
        last = self.steps - round(self.freeze_share * self.steps)
        return self.lens_rate > 0 and self.hold_steps * has_network <= step < last
