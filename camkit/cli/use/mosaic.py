"""The options of headerless mosaics, shared by the commands that read captures."""

from typing import TYPE_CHECKING

from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.runtime.capture import MosaicOptions


def mosaic_options(
    cfa: str | None, black_level: float | None, white_level: float | None
) -> "MosaicOptions | None":
    """Give the mosaic options, or None when none of the three is given.

    Raises:
        ContractError: If only some of the three are given.
    """
    if cfa is None and black_level is None and white_level is None:
        return None
    if cfa is None or black_level is None or white_level is None:
        raise ContractError("a headerless mosaic needs --mosaic, --black-level and --white-level")
    from camkit.runtime.capture import MosaicOptions

    return MosaicOptions(cfa=cfa, black_level=black_level, white_level=white_level)  # type: ignore[arg-type]
