"""Options that describe a camera: `camkit recipe` and `camkit make` share them."""

from pathlib import Path
from typing import Annotated, Final

import typer

from camkit.errors import ContractError

SensorText = Annotated[
    str | None,
    typer.Option(
        help="Sensor as WIDTHxHEIGHT@PITCHum, such as 6000x4000@3.9um, or a name such as IMX264."
    ),
]
Photo = Annotated[
    Path | None,
    typer.Option(
        "--from",
        help="RAW file of the camera, whose sensor is taken, or a developed picture.",
        metavar="FILE",
    ),
]
PitchUm = Annotated[
    float | None, typer.Option(help="Pixel pitch in um, where the RAW file does not state it.")
]
FNumber = Annotated[
    float | None,
    typer.Option(help="F-number (EFL / entrance pupil) to stop to; default: the lens file's."),
]
StopRadiusMm = Annotated[
    float | None, typer.Option(help="Radius of the stop in mm, in place of the F-number.")
]
FocusM = Annotated[
    float | None,
    typer.Option(
        help="Distance in m ('inf' for infinity) to focus the lens on; default: the file's."
    ),
]
ObjectM = Annotated[
    str | None,
    typer.Option(help="Distances of the scene in m, such as 0.5,1,inf; default: the focus."),
]
DistanceFrom = Annotated[
    str,
    typer.Option(help="What distances count from: vertex (of the first surface), sensor or pupil."),
]
DefocusMm = Annotated[
    float, typer.Option(help="Shift of the sensor behind its place in focus, in mm.")
]
VERTEX: Final = "vertex"


def distances_m(text: str | None) -> tuple[float, ...]:
    """Read distances A,B,C.

    Raises:
        ContractError: If one is no number.
    """
    try:
        return tuple(float(part) for part in text.split(",")) if text else ()
    except ValueError:
        raise ContractError(f"--object-m takes distances A,B,C in m; got {text!r}") from None
