"""The refusal of a camera that cannot be made portable, by the name of what has no graph."""

from typing import Final

from camkit.bundle.manifest import Manifest
from camkit.errors import UnsupportedError

STAGES_OF_HOST: Final = {
    "highlights": "stage highlights solves for the light of lamps until it settles",
    "deglare": "stage deglare searches the whole capture for streaks",
}
"""Why a stage has no graph without control flow."""


def refusal(manifest: Manifest, reason: str) -> UnsupportedError:
    """Return the error of a camera that cannot be made portable."""
    return UnsupportedError(f"{manifest.name} cannot be made portable: {reason}")


def stage_of_host(manifest: Manifest) -> str | None:
    """Return why a stage of a camera has no graph; None if none is known to have none."""
    reasons = (STAGES_OF_HOST.get(stage.type) for stage in manifest.stages)
    return next((reason for reason in reasons if reason is not None), None)
