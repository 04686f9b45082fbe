"""What is said of a mosaic in place of its file, shared by the commands that read captures."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from camkit.runtime.capture import MosaicOptions


def mosaic_options(
    cfa: str | None, black_level: float | None, white_level: float | None
) -> "MosaicOptions | None":
    """Give the mosaic options, or None when none of the three is given.

    Raises:
        ContractError: If they contradict each other, or a pattern comes without its levels.
    """
    if cfa is None and black_level is None and white_level is None:
        return None
    from camkit.runtime.capture import MosaicOptions

    return MosaicOptions(cfa=cfa, black_level=black_level, white_level=white_level)  # type: ignore[arg-type]
