"""The targets of a display, one PNG each, and `targets.toml`, which describes them.

    board, grey steps      fill the screen, without marks: nothing else may be in it
    colours, pictures      with marks, by which a capture is matched to its target

Numbers of marks count the targets that have marks, from 0.
"""

import re
from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, Self, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.calibration.display.displayed_picture import read_shown
from camkit.calibration.display.marks import NUMBERS, draw_word
from camkit.calibration.display.screen import Place, Screen
from camkit.calibration.geometry.board import Board
from camkit.caller import option_text
from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.side_file import read_side_toml

Kind = Literal["board", "grey", "colour", "picture"]
Codes = NDArray[np.uint8]

LIST: Final = "targets.toml"
TOP: Final = 255
HALF: Final = 128
COLOURS: Final = {
    "red": (TOP, 0, 0),
    "green": (0, TOP, 0),
    "blue": (0, 0, TOP),
    "red-half": (HALF, 0, 0),
    "green-half": (0, HALF, 0),
    "blue-half": (0, 0, HALF),
    "white": (TOP, TOP, TOP),
}
_PATCH_ASPECT: Final = 1.5
_NO_LIST: Final = (
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)
_UNSAFE: Final = re.compile(r"[^A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One picture of the screen.

    Attributes:
        file: Its name in the folder.
        name: Of what it shows; no two are alike.
        kind: What it is.
        rgb: What the display is told, 0..255, of a grey or a colour.
        code: What its marks say; None where it has none.
        place_px: Of board, colour or picture on the screen.
        square_px: Side of the squares of a board.
        source: Name of the file that is shown, and its colour space.
    """

    file: str
    name: str
    kind: Kind
    rgb: tuple[int, int, int] | None = None
    code: int | None = None
    place_px: Place | None = None
    square_px: int | None = None
    source: tuple[str, str] | None = None

    def to_record(self) -> dict[str, Any]:
        """Return plain values, without those that a target does not have."""
        record: dict[str, Any] = {"file": self.file, "name": self.name, "kind": self.kind}
        if self.kind == "grey" and self.rgb is not None:
            record["level"] = self.rgb[0]
        elif self.rgb is not None:
            record["rgb"] = list(self.rgb)
        for name in ("code", "square_px"):
            if getattr(self, name) is not None:
                record[name] = getattr(self, name)
        if self.place_px is not None:
            record["place_px"] = list(self.place_px)
        if self.source is not None:
            record["source"], record["space"] = self.source
        return record


@dataclass(frozen=True, slots=True, kw_only=True)
class Targets:
    """All that a display shows.

    Attributes:
        screen: The display.
        board: What the checkerboard is.
        targets: In the order of showing.
    """

    screen: Screen
    board: Board
    targets: tuple[Target, ...]

    @property
    def by_code(self) -> dict[int, Target]:
        """Return the targets that have marks, by the code of the marks."""
        return {target.code: target for target in self.targets if target.code is not None}

    def holds(self, target: Target) -> bool:
        """Return whether a target lies on the screen."""
        if target.place_px is None:
            return True
        x, y, width, height = target.place_px
        across, down = x + width <= self.screen.width_px, y + height <= self.screen.height_px
        return min(x, y) >= 0 and min(width, height) > 0 and across and down

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "screen_px": [self.screen.width_px, self.screen.height_px],
            "board": str(self.board),
            "targets": [target.to_record() for target in self.targets],
        }

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the list of a folder.

        Raises:
            DecodeError: If it is missing or does not say what is needed.
        """
        path = folder / LIST
        try:
            table = read_side_toml(path, "the list of targets")
        except ContractError as error:
            raise DecodeError(
                f"{error}; {option_text('targets')} is a folder that camkit calibrate targets wrote"
            ) from error
        try:
            width, height = table["screen_px"]
            result = cls(
                screen=Screen(width_px=int(width), height_px=int(height)),
                board=Board.read(table["board"]),
                targets=tuple(_target(one) for one in table["targets"]),
            )
        except _NO_LIST as error:
            raise DecodeError(
                f"{path} is no list of targets ({type(error).__name__}: {error}); write it with "
                "camkit calibrate targets"
            ) from error
        if not all(result.holds(target) for target in result.targets):
            raise DecodeError(f"{path} places a target outside of its screen of {result.screen} px")
        if len(result.by_code) != sum(target.code is not None for target in result.targets):
            raise DecodeError(f"{path} names a code twice")
        return result


def plan_targets(
    pictures: Sequence[Path], screen: Screen, board: Board, levels: Sequence[int]
) -> Targets:
    """Plan the targets; pictures are read once, for their size.

    Raises:
        ContractError: If a picture is given twice, two share a name, or there are too many.
        DecodeError: If a picture cannot be read.
    """
    square, place = screen.squares(board)
    targets = [Target(file="", name="board", kind="board", place_px=place, square_px=square)]
    targets += [Target(file="", name=f"grey-{n}", kind="grey", rgb=(n, n, n)) for n in levels]
    patch = screen.place(_PATCH_ASPECT)
    targets += [
        Target(file="", name=name, kind="colour", rgb=rgb, code=code, place_px=patch)
        for code, (name, rgb) in enumerate(COLOURS.items())
    ]
    if len(pictures) > NUMBERS - len(COLOURS):
        raise ContractError(
            f"expected at most {NUMBERS - len(COLOURS)} pictures, as many as marks can number; got "
            f"{len(pictures)}: write several folders"
        )
    names = _names(pictures, {target.name for target in targets})
    for code, (path, name) in enumerate(zip(pictures, names, strict=True), start=len(COLOURS)):
        light, space = read_shown(path)
        at = screen.place(light.shape[2] / light.shape[1])
        targets.append(
            Target(
                file="",
                name=name,
                kind="picture",
                code=code,
                place_px=at,
                source=(path.name, space),
            )
        )
    digits = max(3, len(str(len(targets))))
    numbered = (
        replace(target, file=f"{n:0{digits}d}-{target.name}.png")
        for n, target in enumerate(targets, start=1)
    )
    return Targets(screen=screen, board=board, targets=tuple(numbered))


def draw_targets(planned: Targets, pictures: Sequence[Path]) -> Iterator[Codes]:
    """Draw one target after the other, (h, w, 3) R, G, B of 8 bits.

    Args:
        planned: As `plan_targets` gave it.
        pictures: As they were given there.
    """
    rest = iter(pictures)
    for target in planned.targets:
        light = read_shown(next(rest))[0] if target.kind == "picture" else None
        yield draw_target(planned, target, light)


def draw_target(planned: Targets, target: Target, light: FloatArray | None = None) -> Codes:
    """Draw one target.

    Args:
        planned: What it is of.
        target: Which.
        light: (3, h, w) linear Rec.709 of a picture.
    """
    screen = planned.screen
    canvas = np.zeros((screen.height_px, screen.width_px, 3), dtype=np.uint8)
    if target.kind == "grey" or target.place_px is None:
        canvas[:] = target.rgb or 0
        return canvas
    x, y, width, height = target.place_px
    inside = np.s_[y : y + height, x : x + width]
    if target.kind == "board":
        canvas[:] = TOP
        canvas[inside] = _squares(planned.board, target.square_px or 1)[..., None]
        return canvas
    for left, top in screen.blocks:
        block = draw_word(target.code or 0, screen.cell_px)
        canvas[top : top + block.shape[0], left : left + block.shape[1]] = block[..., None]
    if light is None:
        canvas[inside] = target.rgb or 0
        return canvas
    fitted = fit_light(light, (width, height))
    canvas[inside] = np.rint(TOP * encode_srgb(fitted)).astype(np.uint8).transpose(1, 2, 0)
    return canvas


def fit_light(light: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Return (3, h, w) light at another width and height: areas when it shrinks, cubic else."""
    way = cv2.INTER_AREA if size[0] < light.shape[2] else cv2.INTER_CUBIC
    planes = [cv2.resize(plane, size, interpolation=way) for plane in np.clip(light, 0, 1)]
    return np.stack(planes).astype(np.float32)


def levels_of_steps(text: str | Sequence[int]) -> tuple[int, ...]:
    """Read the levels of grey steps.

    Raises:
        ContractError: If one is no whole number of 0..255 or comes twice.
    """
    try:
        levels = tuple(map(int, text.split(",") if isinstance(text, str) else text))
    except ValueError:
        raise ContractError(
            f"{option_text('levels')} takes whole numbers separated by commas; got {text!r}"
        ) from None
    if not all(0 <= level <= TOP for level in levels) or len(set(levels)) < len(levels):
        raise ContractError(f"levels are different numbers of 0..{TOP}; got {text!r}")
    return levels


def _squares(board: Board, side: int) -> Codes:
    y, x = np.mgrid[: board.rows + 1, : board.columns + 1]
    squares = np.where((x + y) % 2, TOP, 0).astype(np.uint8)
    return np.kron(squares, np.ones((side, side), dtype=np.uint8))


def _names(pictures: Sequence[Path], reserved: AbstractSet[str]) -> list[str]:
    """Return a name for each that no other target has, of letters that any file system takes."""
    names: dict[str, Path] = {}
    for path in pictures:
        name = _UNSAFE.sub("_", path.stem) or "_"
        if name in names or name in reserved:
            other = names.get(name, "a target of its own")
            raise ContractError(
                f"{path} and {other} would both be called {name}; give every picture once, under "
                "different names"
            )
        names[name] = path
    return list(names)


def _target(table: dict[str, Any]) -> Target:
    kind, rgb = table["kind"], table.get("rgb")
    if kind not in get_args(Kind):
        raise ValueError(f"kind {kind!r}")
    if kind == "grey":
        rgb = [table["level"]] * 3
    place = table.get("place_px")
    marked = kind in ("colour", "picture")
    if marked and (place is None or len(place) != 4 or table.get("code") is None):
        raise ValueError(f"{table['name']!r} has no code or place")
    if Path(table["file"]).name != table["file"] or _UNSAFE.search(table["name"]):
        raise ValueError(f"{table['file']!r} is no name of a file")
    return Target(
        file=table["file"],
        name=table["name"],
        kind=kind,
        rgb=None if rgb is None else (int(rgb[0]), int(rgb[1]), int(rgb[2])),
        code=None if table.get("code") is None else int(table["code"]),
        place_px=None if place is None else tuple(int(n) for n in place),  # type: ignore[arg-type]
        square_px=table.get("square_px"),
        source=(table["source"], table["space"]) if "source" in table else None,
    )
