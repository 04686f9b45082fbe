"""A coded capture and the bracket beside it, as light: response, black and white from the bracket.

    bracket -> which codes clipped -> black offset, exposures -> merged light
    capture ---------------------------------^----------------> light and what clipped

Light is in units of the white of the capture: 1.0 is code 255 of its exposure. The pictures are of
8 bits and say nothing of themselves, so all of it is found:

- **Clipping.** Colours of a camera are mixed after they clipped, so that green may end at a code
  of its own where red and blue are full. In the bracket a pixel counts as clipped in all colours
  where one did: other frames hold it. In the capture, of which there is one, a colour is clipped
  from the code at which it ends; what mixing did to the others is not known.
- **Response.** Light is code + offset (what was cut at black), the offset that of the line of one
  frame's codes over those of the next. By how many codes the frames disagree is stated for it, for
  no offset, for sRGB and for `estimate_response`, which supposes nothing.
- **Exposures.** Names state stops. How much longer a frame was exposed than the next is the ratio
  of their sums over pixels that both hold.
"""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.errors import DecodeError
from camkit.runtime.merging.merge import merge
from camkit.runtime.merging.response import Response, response_of, srgb_response
from camkit.runtime.merging.response_estimate import disagreement, estimate_response
from camkit.runtime.merging.survey import SAMPLED_PIXELS, survey

CODED: Final = "wPSF_*_stop.png"
BARE: Final = "woutPSF_*_stop.png"
CODES: Final = 256
FULL: Final = 253
"""From here on a code is clipped, as `camkit merge` has it."""
LEAST_PIXELS: Final = 200
MOST_ALIKE: Final = 0.9
"""Frames more alike in exposure do not tell an offset."""
TINY: Final = 1e-12
DARKEST_CODE: Final = 8
"""Codes of the shorter of two frames below it tell little of their ratio."""

Codes = NDArray[np.uint8]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class CodedScene:
    """What was captured, as light; 1.0 = white of the coded capture.

    Attributes:
        capture: (3, h, w) float32, through the plate.
        clipped: (3, h, w), samples of it that clipped.
        levels: (3,) light at which the colours of the capture clip.
        bare: (3, h, w) float32, the frame without plate of the capture's exposure, clipped.
        reference: (3, h, w) float32, the merged bracket.
        clipping_codes: (3,) codes at which the colours of the capture clip.
        black_offset: What was cut at black, in codes.
        facts: How the light was come by.
    """

    capture: FloatArray
    clipped: Mask
    levels: FloatArray
    bare: FloatArray
    reference: FloatArray
    clipping_codes: NDArray[np.intp]
    black_offset: float
    facts: dict[str, Any]


def read_scene(folder: Path) -> CodedScene:
    """Read and calibrate a scene.

    Args:
        folder: One capture named as `CODED`, frames named as `BARE`, of the same size; the stops
            of exposure stand in the names.

    Raises:
        DecodeError: If they are not there or cannot be read.
    """
    capture, frames = _files(folder)
    codes, at = _read(capture), stated_stops(capture)
    bracket, stops = [_read(file) for file in frames], np.array([stated_stops(f) for f in frames])
    if any(frame.shape != codes.shape for frame in bracket):
        raise DecodeError(f"{folder}: the pictures differ in size")
    levels = clipping_codes(codes)
    masked = [np.where((f >= FULL).any(axis=0), 255, f).astype(np.uint8) for f in bracket]
    offset = black_offset(masked, stops)
    exposed = measured_stops(masked, stops, offset)
    light, misses = _merged(masked, exposed, offset)
    here = float(np.interp(at, stops[::-1], exposed[::-1]))
    facts = {
        "frames": len(frames),
        "black_offset_codes": offset,
        "clipping_codes": levels.tolist(),
        "disagreement_codes": misses,
        "stops_stated": stops.tolist(),
        "stops_measured": [round(float(s), 3) for s in exposed - here + at],
    }
    return CodedScene(
        capture=_light(codes, offset),
        clipped=clipped_samples(codes, levels),
        levels=_light(levels.astype(np.uint8), offset),
        bare=_light(bracket[int(np.argmin(np.abs(stops - at)))], offset),
        reference=light * np.float32(2.0 ** (here - exposed[0])),
        clipping_codes=levels,
        black_offset=offset,
        facts=facts,
    )


def stated_stops(file: Path) -> float:
    """Return the stops in the name of a file.

    Raises:
        DecodeError: If there is no number.
    """
    try:
        return float(file.name.split("_")[1])
    except ValueError as error:
        raise DecodeError(f"{file.name}: expected stops of exposure between _ and _") from error


def clipping_codes(codes: Codes) -> NDArray[np.intp]:
    """Return for every colour the code at which it ends, `FULL` unless it ends below.

    It ends below where most pixels whose other two colours are full have one code.

    Args:
        codes: (3, h, w).
    """
    found = []
    for colour in range(3):
        others = np.delete(codes, colour, axis=0)
        counts = np.bincount(codes[colour][(others >= FULL).all(axis=0)], minlength=CODES)
        end = int(counts.argmax())
        ends = counts.sum() >= LEAST_PIXELS and counts[end] >= counts.sum() / 2
        found.append(min(end, FULL) if ends else FULL)
    return np.array(found)


def clipped_samples(codes: Codes, levels: NDArray[np.intp]) -> Mask:
    """Return which samples of (3, h, w) are at the (3,) levels of their colours or above."""
    return np.asarray(codes >= levels[:, None, None])


def offset_response(offset: float) -> Response:
    """Return the response of codes that are light less an offset; 1.0 = code 255."""
    light = (np.arange(CODES) + offset) / (CODES - 1 + offset)
    with np.errstate(divide="ignore"):
        return response_of("linear", np.tile(np.log(light), (3, 1)))


def black_offset(frames: Sequence[Codes], stops: NDArray[np.float64]) -> float:
    """Return what was cut at black, in codes.

    A frame of an r-th of the exposure of another has (code + offset) / r - offset: a line, whose
    slope tells r and whose foot the offset. The median over colours and neighbours in time, each
    by its certainty; 0 where no two frames have enough in common.

    Args:
        frames: As in `measured_stops`.
        stops: As stated.
    """
    found: list[tuple[float, float]] = []
    for n in range(1, len(frames)):
        both = _shared(frames[n - 1], frames[n], stops[n - 1] - stops[n])
        for longer, shorter, told in zip(frames[n - 1], frames[n], both, strict=True):
            x, y = (plane[told].astype(np.float64) for plane in (longer, shorter))
            if x.size < LEAST_PIXELS or np.ptp(x) == 0:
                continue
            spread = np.mean((x - x.mean()) ** 2)
            slope = np.mean((x - x.mean()) * (y - y.mean())) / spread
            foot = y.mean() - slope * x.mean()
            if slope < MOST_ALIKE:
                rest = np.mean((y - foot - slope * x) ** 2) * (1 + x.mean() ** 2 / spread) / x.size
                found.append((-foot / (1 - slope), (1 - slope) / np.sqrt(rest + TINY)))
    if not found:
        return 0.0
    offsets, weights = np.array(sorted(found)).T
    middle = np.searchsorted(np.cumsum(weights), weights.sum() / 2)
    return round(float(offsets[middle]), 3)


def measured_stops(
    frames: Sequence[Codes], stops: NDArray[np.float64], offset: float
) -> NDArray[np.float64]:
    """Return the exposure of every frame in stops beside the longest.

    Args:
        frames: (3, h, w) each, longest first, clipped pixels full in all colours.
        stops: As stated; what two frames have too little in common for is taken from here.
        offset: Of black, in codes.
    """
    found = [0.0]
    for n in range(1, len(frames)):
        longer, shorter, stated = frames[n - 1], frames[n], stops[n - 1] - stops[n]
        both = _shared(longer, shorter, stated)
        if np.count_nonzero(both) >= LEAST_PIXELS:
            sums = [float(np.sum(f[both] + offset, dtype=np.float64)) for f in (longer, shorter)]
            stated = float(np.log2(sums[0] / sums[1]))
        found.append(found[-1] - stated)
    return np.array(found)


def _shared(longer: Codes, shorter: Codes, stops: float) -> Mask:
    """Return which samples of two frames, so many stops apart, tell their ratio.

    They are chosen by the longer frame, whose noise is less, lest those that noise raised be taken.
    """
    open_ = (longer < FULL) & (shorter < FULL)
    return np.asarray(open_ & (longer >= DARKEST_CODE * 2.0**stops))


def _lattice(frames: Sequence[Codes]) -> Codes:
    """Return (frame, 3, pixel) codes of the same pixels of every frame."""
    step = max(1, math.isqrt(frames[0][0].size // SAMPLED_PIXELS))
    return np.stack([frame[:, ::step, ::step].reshape(3, -1) for frame in frames])


def _merged(
    frames: Sequence[Codes], exposed: NDArray[np.float64], offset: float
) -> tuple[FloatArray, dict[str, float]]:
    """Return the light, 1.0 = white of the longest frame, and by how much responses disagree."""
    times_s, lattice = 2.0**exposed, _lattice(frames)
    with tempfile.TemporaryDirectory() as folder:
        bracket = survey(_written(frames, Path(folder)), times_s.tolist())
        light = merge(bracket, offset_response(offset)).light
    tried = {
        "linear_with_offset": offset_response(offset),
        "linear": offset_response(0.0),
        "estimate": estimate_response(lattice, times_s),
        "srgb": srgb_response(CODES),
    }
    return light, {n: round(disagreement(lattice, times_s, r), 3) for n, r in tried.items()}


def _files(folder: Path) -> tuple[Path, list[Path]]:
    """Return the capture and the frames of a folder, longest first."""
    coded, frames = sorted(folder.glob(CODED)), sorted(folder.glob(BARE))
    if len(coded) != 1 or len(frames) < 2:
        raise DecodeError(
            f"{folder}: expected one {CODED}, two {BARE} or more; got {len(coded)}, {len(frames)}"
        )
    return coded[0], sorted(frames, key=stated_stops, reverse=True)


def _written(frames: Sequence[Codes], folder: Path) -> list[Path]:
    files = [folder / f"{n:03d}.png" for n in range(len(frames))]
    for file, frame in zip(files, frames, strict=True):
        cv2.imwrite(str(file), frame.transpose(1, 2, 0)[..., ::-1])
    return files


def _read(file: Path) -> Codes:
    picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if picture is None or picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
        raise DecodeError(f"{file}: expected a picture of three colours of 8 bits")
    return np.ascontiguousarray(picture[..., ::-1].transpose(2, 0, 1)).astype(np.uint8)


def _light(codes: Codes, offset: float) -> FloatArray:
    return ((codes + np.float32(offset)) / np.float32(CODES - 1 + offset)).astype(np.float32)
