"""Light of the codes of developed pictures: by the curve of sRGB, by none, or by a measured one."""

import hashlib
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from camkit.bundle.entry import Entry, NonNegative
from camkit.caller import option_text
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.side_file import read_side_toml

FloatGrid = NDArray[np.float64]

TOP_LEVEL: Final = 255.0
SRGB_CURVE: Final = "srgb"
NO_CURVE: Final = "linear"
CURVES: Final = (SRGB_CURVE, NO_CURVE)
"""Names in place of a file."""
_GAMMA: Final = 2.2


class ToneFile(Entry, extra="ignore"):
    """A result of `camkit calibrate tone`, as far as pairs and pictures take it."""

    levels: Annotated[tuple[NonNegative, ...], Field(min_length=2, max_length=1024)]
    luminance: tuple[NonNegative, ...]

    @model_validator(mode="after")
    def _check(self) -> "ToneFile":
        levels, light = self.levels, self.luminance
        if len(light) != len(levels):
            raise ValueError(f"{len(levels)} levels have {len(light)} luminances")
        if any(b <= a for a, b in pairwise(levels)) or any(b < a for a, b in pairwise(light)):
            raise ValueError("levels and luminance must rise together")
        if levels[0] != 0 or levels[-1] != TOP_LEVEL or light[-1] <= light[0]:
            raise ValueError("levels must reach from 0 to 255, and luminance rise between them")
        return self


def measured_light(path: Path) -> FloatGrid:
    """Read a result of `camkit calibrate tone`.

    Black is taken off: it is the same in all that is shown.

    Returns:
        (256,) light of the levels 0 to 255, 0 at black and 1 at white.

    Raises:
        DecodeError: If it is not what that command writes, or does not reach from 0 to 255.
    """
    from scipy.interpolate import PchipInterpolator

    try:
        file = ToneFile.model_validate(read_side_toml(path, "the measured file"))
    except ContractError as error:
        raise DecodeError(str(error)) from error
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise DecodeError(
            f"{path} is not what `camkit calibrate tone` writes: {where}: {first['msg']}"
        ) from error
    light = np.array(file.luminance)
    # a power of about 2.2 makes the curve nearly straight between steps
    share = (light - light[0]) / (light[-1] - light[0])
    every = np.arange(TOP_LEVEL + 1)
    root = PchipInterpolator(np.array(file.levels), share ** (1 / _GAMMA))(every)
    return np.asarray(root**_GAMMA / root[-1] ** _GAMMA)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tone:
    """The tone curve of developed pictures.

    Attributes:
        name: srgb, linear, or that of a file.
        light: Of a measured curve: light of the codes 0 to 255; empty for the others.
    """

    name: str
    light: tuple[float, ...] = ()

    @property
    def is_linear(self) -> bool:
        """Return whether codes are light already."""
        return not self.light and self.name == NO_CURVE

    def light_at(self, codes: FloatGrid) -> FloatGrid:
        """Return the light of codes, both 0..1."""
        if self.is_linear:
            return codes
        if not self.light:
            return decode_srgb(codes.astype(np.float32)).astype(np.float64)
        roots = np.array(self.light) ** (1 / _GAMMA)
        return np.asarray(np.interp(codes, np.linspace(0, 1, len(roots)), roots) ** _GAMMA)

    def to_json(self) -> dict[str, Any]:
        """Return the name, and the hash of a measured curve."""
        if not self.light:
            return {"name": self.name}
        digest = hashlib.sha256(np.array(self.light).tobytes()).hexdigest()
        return {"name": self.name, "sha256": digest}


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureReading:
    """The caller's words on a developed picture.

    Attributes:
        keep_codes: Whether codes of up to 8 bits stay as they are, white at 255.
        tone: How codes become light; None for what the file and its bits state.
        is_grey: Whether it is of a camera with one channel, which grey then stays.
    """

    keep_codes: bool = False
    tone: Tone | None = None
    is_grey: bool = False


AS_STATED: Final = PictureReading()


def read_tone(choice: str | PathLike[str]) -> Tone:
    """Return the tone curve of a name, srgb or linear, or of a file of `camkit calibrate tone`.

    Raises:
        ContractError: If it is neither.
    """
    if str(choice) in CURVES:
        return Tone(name=str(choice))
    path = Path(choice)
    try:
        return Tone(name=path.name, light=tuple(measured_light(path).tolist()))
    except DecodeError as error:
        raise ContractError(
            f"{option_text('tone')} takes {', '.join(CURVES)} or a file of `camkit calibrate "
            f"tone`; {error}"
        ) from error
