"""Captures of shown pictures to a folder that `camkit train --fine-tune --pairs` reads.

    captures -> sorted by marks -> pictures laid over them -> checked, all of them
      -> the display's colours -> capture/NAME.tiff, reference/NAME.png, pairs.toml

The first pass keeps what was found and no pixels; the second develops and writes one pair after
the other.

References: Sun 2021, section 3.6 (the display-capture set-up).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.calibration.display.alignment import Patch, align, map_places
from camkit.calibration.display.camera_file import Illumination, Lens, Tone
from camkit.calibration.display.primaries import Primaries, fit_primaries
from camkit.calibration.display.reference import filled_rectangle, reference_of
from camkit.calibration.display.screen import Place
from camkit.calibration.display.sorting import Sorted, check_whole, sort_view
from camkit.calibration.display.targets import Target, Targets
from camkit.calibration.display.tiles import tile_shifts
from camkit.calibration.display.view import View, colours_of, read_view
from camkit.calibration.tone import exposures_of
from camkit.caller import option_text
from camkit.errors import CamkitError, ContractError, DecodeError
from camkit.progress import counted
from camkit.runtime.capture import Capture

FloatGrid = NDArray[np.float64]

MOST_RESIDUAL_PX: Final = 0.5
MOST_CAPTURES: Final = 1000
MOST_CLIPPED: Final = 1e-3
PATCH: Final = 0.6
"""Side of what is measured of a colour, of the side of its patch."""
_MARGIN: Final = 8
_BAND_ROWS: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class References:
    """The references of captures.

    Attributes:
        folder: Of the targets.
        targets: Its list.
        lens: The geometry of the camera.
        tone: The curve of the display.
        flat: The vignetting of the camera.
        most_residual_px: Above which a pair is refused.
    """

    folder: Path
    targets: Targets
    lens: Lens
    tone: Tone
    flat: Illumination = field(default_factory=Illumination)
    most_residual_px: float = MOST_RESIDUAL_PX

    def __post_init__(self) -> None:
        if not 0 < self.most_residual_px < np.inf:
            raise ContractError(
                f"{option_text('most_residual_px')} must be > 0; got {self.most_residual_px:g}"
            )

    def light_of(self, target: Target) -> FloatArray:
        """Return (3, h, w) light of what a picture's target shows, in its place.

        Raises:
            DecodeError: If the file is not there, or is not as the list says.
        """
        path = self.folder / target.file
        try:
            data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
        except OSError as error:
            raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error
        codes = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
        screen = self.targets.screen
        if codes is None or codes.shape[:2] != (screen.height_px, screen.width_px):
            raise DecodeError(f"{path} is no picture of {screen} px, as the list of targets says")
        x, y, width, height = target.place_px or (0, 0, 0, 0)
        inside = codes[y : y + height, x : x + width, ::-1]
        light = self.tone.light.astype(np.float32)[inside]
        return np.ascontiguousarray(light.transpose(2, 0, 1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """A capture and its picture.

    Attributes:
        path: The capture.
        target: What it shows.
        to_picture: (3, 3) places without distortion -> px of the shown picture.
        residual_px: RMS of the shifts, px of the capture.
        correlation: Of capture and picture.
        places_px: (tile, 2) middles of tiles, px of the capture.
        shifts_px: (tile, 2) what is left there.
        reference_px: Place of the reference in the capture without distortion.
    """

    path: Path
    target: Target
    to_picture: FloatGrid
    residual_px: float
    correlation: float
    places_px: FloatGrid
    shifts_px: FloatGrid
    reference_px: Place

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "name": self.target.name,
            "file": self.path.name,
            "residual_px": round(self.residual_px, 4),
            "correlation": round(self.correlation, 5),
            "homography": np.linalg.inv(self.to_picture).tolist(),
            "reference_px": list(self.reference_px),
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pairs:
    """All pairs of a set.

    Attributes:
        pairs: In the order of showing.
        primaries: The colours of the display; None where none were captured.
        size: Width and height of captures.
        iso: Of all pictures.
        white_balance: Gains that are put into the captures; None where nobody states them.
        notes: What people should know.
    """

    pairs: tuple[Pair, ...]
    primaries: Primaries | None
    size: tuple[int, int]
    iso: float
    white_balance: tuple[float, float, float] | None
    notes: tuple[str, ...]

    def settings(self) -> dict[str, Any]:
        """Return the values of `pairs.toml`."""
        gains = {} if self.white_balance is None else {"white_balance": list(self.white_balance)}
        return {"iso": self.iso, **gains}

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        display = {} if self.primaries is None else {"display": self.primaries.to_record()}
        return {
            **self.settings(),
            "notes": list(self.notes),
            **display,
            "pairs": [pair.to_record() for pair in self.pairs],
        }


def find_pairs(files: Sequence[Path], references: References) -> Pairs:
    """Sort captures and align every picture with its own.

    Raises:
        ContractError: If a file is given twice, or there are too many.
        DecodeError: If captures and targets do not belong together, one to one, or a picture lies
            on its capture worse than allowed; names the file.
    """
    if len({path.resolve() for path in files}) < len(files):
        raise ContractError("a capture is given twice; give every capture once")
    if len(files) > MOST_CAPTURES:
        raise ContractError(f"expected at most {MOST_CAPTURES} captures; got {len(files)}")
    captures: list[Sorted] = []
    for path in counted(files, "finding marks", "captures"):
        view, _ = read_view(path, references.lens)
        captures.append(sort_view(view, references.lens, references.targets))
    check_whole(captures, references.targets)
    order = {target.name: n for n, target in enumerate(references.targets.targets)}
    captures.sort(key=lambda one: order[one.target.name])
    pairs, likes = [], []
    for one in captures:
        if one.target.kind == "picture":
            pair, like = _pair(one, references)
            pairs.append(pair)
            likes.append(like)
    iso = _iso(pairs, likes)
    primaries, notes = _primaries(
        [one for one in captures if one.target.kind == "colour"], references
    )
    if not references.tone.measured:
        notes.append("no tone curve of the display: what it shows is taken as sRGB")
    gains = likes[0].white_balance
    if gains is None and likes[0].cfa is not None:
        gains = (1.0, 1.0, 1.0)
    if gains is None:
        notes.append("captures state no white balance; pairs.toml leaves it out, which means D65")
    return Pairs(
        pairs=tuple(pairs),
        primaries=primaries,
        size=references.lens.size,
        iso=iso,
        white_balance=gains,
        notes=tuple(notes),
    )


def draw_pairs(
    pairs: Pairs, references: References
) -> Iterator[tuple[NDArray[np.uint16], NDArray[np.uint8]]]:
    """Yield capture (h, w, 3) of 16 bits and reference (m, n, 3) of 8 bits, pair by pair."""
    from camkit.runtime.options import Options
    from camkit.runtime.pipeline import load

    options = Options(color="camera", white_balance=pairs.white_balance)
    pipeline = load(None, options=options)
    for pair in pairs.pairs:
        view, capture = read_view(pair.path, references.lens)
        if view.like.cfa is None:
            light = capture.linear_rows(0, capture.height)
            if pairs.white_balance is not None:
                light *= np.array(pairs.white_balance, dtype=np.float32)[:, None, None]
        else:
            light = pipeline.process(pair.path).image
        counts = np.rint(np.clip(light, 0, 1) * 65535).astype(np.uint16).transpose(1, 2, 0)
        picture = references.light_of(pair.target)
        yield counts, reference_of(picture, pair.to_picture, pair.reference_px)


def _pair(one: Sorted, references: References) -> tuple[Pair, Capture]:
    """Align one picture with its capture.

    Raises:
        DecodeError: As `find_pairs`; names the capture.
    """
    view, _ = read_view(one.path, references.lens)
    target, picture = one.target, references.light_of(one.target)
    x, y, width, height = target.place_px or (0, 0, 0, 0)
    start = np.array([[1, 0, -x], [0, 1, -y], [0, 0, 1.0]]) @ one.to_screen
    try:
        box = _box(view, start, (width, height))
        patch = _patch(view, box, references)
        aligned = align(patch, picture, start / start[2, 2])
        at, shifts = tile_shifts(patch.grey, aligned.model, aligned.inside)
        rectangle = filled_rectangle(aligned.to_picture, (width, height), references.lens.size)
    except CamkitError as error:
        raise DecodeError(f"{one.path.name} ({target.file}): {error}") from error
    shifts_px = shifts * view.scale
    residual = float(np.sqrt(np.mean((shifts_px**2).sum(axis=1))))
    if not residual <= references.most_residual_px:
        raise DecodeError(
            f"{one.path.name}: the picture of {target.file} lies on it to {residual:.2f} px RMS, "
            f"{references.most_residual_px:g} is allowed ({option_text('most_residual_px')}): is "
            "the geometry that of this camera, lens and focus, and the display flat?"
        )
    pair = Pair(
        path=one.path,
        target=target,
        to_picture=aligned.to_picture,
        residual_px=residual,
        correlation=aligned.correlation,
        places_px=view.places(at + np.array(box[:2])),
        shifts_px=shifts_px,
        reference_px=rectangle,
    )
    return pair, view.like


def _box(view: View, to_picture: FloatGrid, size: tuple[int, int]) -> Place:
    """Return the window of the lattice that holds a picture; distortion bends it by a margin."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]) * size
    places = map_places(np.asarray(np.linalg.inv(to_picture)), corners) / view.scale
    height, width = view.grey.shape
    margin = _MARGIN + 0.05 * max(np.ptp(places[:, 0]), np.ptp(places[:, 1]))
    left, top = np.clip(np.floor(places.min(axis=0) - margin), 0, (width, height)).astype(int)
    right, bottom = np.clip(np.ceil(places.max(axis=0) + margin), 0, (width, height)).astype(int)
    if min(right - left, bottom - top) < _MARGIN:
        raise DecodeError("its picture lies outside the capture")
    return int(left), int(top), int(right - left), int(bottom - top)


def _patch(view: View, box: Place, references: References) -> Patch:
    x, y, width, height = box
    window = np.s_[y : y + height, x : x + width]
    here = np.stack(np.meshgrid(np.arange(x, x + width), np.arange(y, y + height)), axis=-1)
    even = references.flat.at(view.places(here.astype(np.float64)))
    return Patch(
        grey=np.asarray(view.grey[window] / even, dtype=np.float32),
        usable=~view.clipped[window],
        ideal_px=view.window(references.lens, box),
    )


def _iso(pairs: Sequence[Pair], likes: Sequence[Capture]) -> float:
    """Return the ISO of all pictures, which `pairs.toml` states once."""
    isos = [like.iso or like.metadata.iso for like in likes]
    for pair, iso in zip(pairs, isos, strict=True):
        if iso is None:
            raise DecodeError(f"{pair.path.name} states no ISO, which training asks for")
        if iso != isos[0]:
            raise DecodeError(
                f"{pairs[0].path.name} was taken at ISO {isos[0]:g}, {pair.path.name} at ISO "
                f"{iso:g}; a folder of pairs has one"
            )
    return float(isos[0] or 0)


def _primaries(
    colours: Sequence[Sorted], references: References
) -> tuple[Primaries | None, list[str]]:
    if not colours:
        return None, ["no captures of the colours: the display's primaries are not known"]
    lights, likes = [], []
    for one in colours:
        view, capture = read_view(one.path, references.lens)
        light, clipped = colours_of(capture, _middle(one, references.lens), references.flat)
        if clipped > MOST_CLIPPED:
            raise DecodeError(
                f"{one.path.name} ({one.target.file}): {clipped:.1%} is clipped; expose less"
            )
        lights.append(light)
        likes.append(view.like)
    exposures, notes = exposures_of([one.path for one in colours], likes)
    display = [references.tone.light[list(one.target.rgb or (0, 0, 0))] for one in colours]
    light = np.array(lights) / np.array(exposures)[:, None]
    names = [one.target.name for one in colours]
    return fit_primaries(names, np.array(display), light), notes


def _middle(one: Sorted, lens: Lens) -> NDArray[np.bool_]:
    """Return (h, w) of the capture where the middle of a colour's patch is seen."""
    x, y, width, height = one.target.place_px or (0, 0, 0, 0)
    rim = (1 - PATCH) / 2
    wide, high = lens.size
    low = np.array([x + rim * width, y + rim * height])
    end = low + PATCH * np.array([width, height])
    bands = []
    for rows in np.array_split(np.arange(float(high)), -(-high // _BAND_ROWS)):
        at = map_places(one.to_screen, lens.lattice(np.arange(float(wide)), rows))
        bands.append((at >= low).all(axis=-1) & (at <= end).all(axis=-1))
    inside = np.concatenate(bands)
    if not inside.any():
        raise DecodeError(f"{one.path.name} does not show the middle of {one.target.file}")
    return np.asarray(inside)
