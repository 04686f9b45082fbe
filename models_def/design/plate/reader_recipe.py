"""The table [reader] of a plate's recipe: the network that reads the pictures of the plate."""

from dataclasses import dataclass

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class ReaderRecipe:
    """A network that is fitted while the plate is designed.

    Attributes:
        recipe: Of a snapshot HDR camera (.toml), relative to the recipe of the plate: its sensor,
            how much saturates, its networks and their schedules.
        size: Which network of its role `whole`, from the capture to the picture.
        begin: Checkpoint of `camkit train` or of a joint design, relative likewise, whose weights
            are the first; empty for random ones.
        weight: Of the picture's loss beside the goal's.
        network_steps: Of the network, for one of the plate; it follows the mean slope over them.
        hold_steps: Steps of the plate, at first, in which it stays and the network learns alone.
        batch: Patches of a step of the network.
        patch_px: Side of a patch.
        scenes: How many different scenes.
        scene_px: Their side; a patch and the window of the PSF must lie within.
        valid_patches: Fixed patches that are never trained on.
    """

    recipe: str
    size: str
    begin: str = ""
    weight: float = 1.0
    network_steps: int = 4
    hold_steps: int = 0
    batch: int = 4
    patch_px: int = 96
    scenes: int = 256
    scene_px: int = 384
    valid_patches: int = 16

    def __post_init__(self) -> None:
        """Refuse a reader that cannot read.

        Raises:
            ContractError: If so.
        """
        counts = (self.network_steps, self.batch, self.patch_px, self.scenes, self.valid_patches)
        if min(counts) < 1 or self.hold_steps < 0 or not self.weight >= 0:
            raise ContractError(
                "reader needs network_steps, batch, patch_px, scenes, valid_patches >= 1 and "
                f"hold_steps, weight >= 0; got {self}"
            )
