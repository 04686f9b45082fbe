"""Options of a headerless mosaic and of its levels, shared by the commands that read captures."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from camkit.runtime.capture import MosaicOptions

MosaicCfa = Annotated[
    str | None,
    typer.Option("--mosaic", help="CFA of a headerless mosaic: RGGB, BGGR, GRBG or GBRG."),
]
BlackLevel = Annotated[float | None, typer.Option(help="Black level in DN; default: the file's.")]
WhiteLevel = Annotated[float | None, typer.Option(help="White level in DN; default: the file's.")]


def mosaic_options(
    cfa: str | None, black_level: float | None, white_level: float | None
) -> "MosaicOptions | None":
    """Return the mosaic options, or None when none of the three is given.

    Raises:
        ContractError: If they contradict each other, or a pattern comes without its levels.
    """
    if cfa is None and black_level is None and white_level is None:
        return None
    from camkit.runtime.capture import MosaicOptions

    return MosaicOptions(cfa=cfa, black_level=black_level, white_level=white_level)  # type: ignore[arg-type]
