"""Pairs of frames read one after the other: what is kept of each is what they tell of noise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.noise.site import BLOCK_PX, FloatGrid, SitePair, site_pair
from camkit.caller import option_text
from camkit.cfa import cfa_channels
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.merging.survey import check_alike, read_frame, without_pixels
from camkit.runtime.raw import is_picture

MOST_CLIPPED: Final = 1e-3
MOST_CUT: Final = 0.01
LEAST_LIGHT: Final = 0.002
MOST_DARK: Final = 0.2
MOST_DRIFT: Final = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A frame of a sensor without its pixels.

    Attributes:
        path: The file.
        like: What it says of itself; its pixels are views of one number.
        iso: As it states it.
        step: The greatest whole number that divides all differences of its samples; 0 for none.
    """

    path: Path
    like: Capture
    iso: float
    step: int

    @property
    def time_s(self) -> float | None:
        """Return its exposure time, where it states one."""
        return self.like.metadata.exposure_time_s or self.like.exposure_time_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two frames of one setting and one light.

    Attributes:
        first: The first; the second is alike.
        second: The second.
        sites: Name of each colour -> what the pair tells of it.
        step: Of the samples of both.
    """

    first: Frame
    second: Frame
    sites: dict[str, SitePair]
    step: int

    @property
    def iso(self) -> float:
        """Return the ISO of both."""
        return self.first.iso

    @property
    def name(self) -> str:
        """Return the names of both files."""
        return f"{self.first.path.name}, {self.second.path.name}"


def in_pairs(files: Sequence[Path], option: str) -> list[tuple[Path, Path]]:
    """Return files two by two in their order.

    Raises:
        DecodeError: If there is none, or one is left over.
        ContractError: If one is given twice.
    """
    if not files or len(files) % 2:
        raise DecodeError(
            f"{option_text(option)} takes pairs, two frames of one light and setting; got "
            f"{len(files)} files"
        )
    paths: set[Path] = set()
    for path in files:
        if path.resolve() in paths:
            raise ContractError(f"{path} is given twice; a pair is two exposures")
        paths.add(path.resolve())
    return list(zip(files[::2], files[1::2], strict=True))


class PairReader:
    """Reads pairs of one sensor."""

    def __init__(self, mosaic: MosaicOptions | None, iso: float | None) -> None:
        """Store what the caller states in place of the files: mosaic, levels, and ISO."""
        self._mosaic, self._iso = mosaic, iso
        self._one: Frame | None = None
        self._by_iso: dict[float, Frame] = {}
        self._hashes: dict[str, Path] = {}

    def dark(self, paths: tuple[Path, Path]) -> Pair:
        """Read two frames without light.

        Raises:
            DecodeError: If they are no pair, or not dark.
        """
        return self._read(paths, {})

    def flat(self, paths: tuple[Path, Path], darks: dict[float, dict[str, float]]) -> Pair:
        """Read two frames of even light.

        Args:
            paths: The files.
            darks: ISO -> name of each colour -> its mean in the dark, in DN above black.

        Raises:
            DecodeError: If they are no pair, clipped, black, or their ISO has no dark frames.
        """
        return self._read(paths, darks)

    def _read(self, paths: tuple[Path, Path], darks: dict[float, dict[str, float]]) -> Pair:
        captures = [self._capture(path) for path in paths]
        first, second = (
            self._frame(path, capture) for path, capture in zip(paths, captures, strict=True)
        )
        if first.iso != second.iso:
            raise DecodeError(
                f"two ISOs in one pair: {first.path.name} has {first.iso:g}, {second.path.name} "
                f"{second.iso:g}; give pairs one after the other"
            )
        check_alike(first.like, first.path, second.like, second.path)
        self._check_sensor(first)
        if darks and first.iso not in darks:
            isos = ", ".join(f"{iso:g}" for iso in sorted(darks))
            raise DecodeError(
                f"{first.path.name} has ISO {first.iso:g}, the dark frames {isos}; give a pair of "
                "darks of every ISO"
            )
        dark = darks.get(first.iso, {})
        for frame, capture in zip((first, second), captures, strict=True):
            (_check_flat if darks else _check_dark)(frame, capture, dark)
        step = int(np.gcd(first.step, second.step))
        sites = {
            name: _site(paths, (one, two), dark.get(name), float(max(step, 1)))
            for name, one, two in zip(
                _names(captures[0]), *(_planes(capture) for capture in captures), strict=True
            )
        }
        return Pair(first=first, second=second, sites=sites, step=step)

    def _capture(self, path: Path) -> Capture:
        capture = read_frame(path, self._mosaic)
        raw = capture.cfa is not None or not is_picture(path)
        if not raw or not np.issubdtype(capture.samples.dtype, np.integer):
            raise DecodeError(f"{path.name} is a picture; noise is measured on RAW files")
        if capture.cfa is None and capture.samples.strides[0] != 0:
            raise DecodeError(
                f"{path.name} was demosaicked already, which mixes the noise of pixels; give RAW "
                "files of the sensor itself"
            )
        return capture

    def _frame(self, path: Path, capture: Capture) -> Frame:
        if capture.sha256 is not None:
            if capture.sha256 in self._hashes:
                raise DecodeError(
                    f"{path.name} is the same file as {self._hashes[capture.sha256].name}, given "
                    "already as a dark or a flat; a pair is two exposures"
                )
            self._hashes[capture.sha256] = path
        iso = capture.iso or capture.metadata.iso or self._iso
        if iso is None:
            raise DecodeError(f"{path.name} states no ISO; add {option_text('iso')}")
        codes = np.flatnonzero(np.bincount(_plane_of(capture).ravel()))
        return Frame(
            path=path,
            like=without_pixels(capture),
            iso=float(iso),
            step=int(np.gcd.reduce(np.diff(codes))) if codes.size > 1 else 0,
        )

    def _check_sensor(self, frame: Frame) -> None:
        one = self._one = self._one or frame
        mine, its = one.like, frame.like
        alike = self._by_iso.setdefault(frame.iso, frame)
        if (mine.width, mine.height, mine.cfa) != (its.width, its.height, its.cfa):
            raise DecodeError(
                f"{frame.path.name} is {its.width}x{its.height} {its.cfa}, {one.path.name} "
                f"{mine.width}x{mine.height} {mine.cfa}; give frames of one sensor"
            )
        check_alike(alike.like, alike.path, its, frame.path)
        if min(mine.width, mine.height) < 2 * BLOCK_PX:
            raise DecodeError(
                f"{frame.path.name} has {its.width}x{its.height} pixels; noise needs "
                f"{2 * BLOCK_PX}x{2 * BLOCK_PX}"
            )


def _plane_of(capture: Capture) -> NDArray[Any]:
    """Return the (h, w) samples; planes of a monochrome sensor are one and the same."""
    return capture.samples if capture.cfa is not None else capture.samples[0]


def _names(capture: Capture) -> list[str]:
    """Return the names of the colours of the cell: R, G1, G2, B in its order, or Y."""
    if capture.cfa is None:
        return ["Y"]
    letters = ["RGB"[channel] for row in cfa_channels(capture.cfa) for channel in row]
    return [
        f"G{letters[:place].count('G') + 1}" if letter == "G" else letter
        for place, letter in enumerate(letters)
    ]


def _planes(capture: Capture) -> Iterator[FloatGrid]:
    """Yield the samples of each colour of the cell, in DN above the stated black."""
    samples = _plane_of(capture)
    if capture.cfa is None:
        yield samples.astype(np.float64) - float(capture.black_level[0])
        return
    high, wide = (n // 2 * 2 for n in samples.shape)
    for dy in (0, 1):
        for dx in (0, 1):
            black = float(capture.black_level[dy, dx])
            yield samples[dy:high:2, dx:wide:2].astype(np.float64) - black


def _range_dn(capture: Capture) -> float:
    return capture.white_level - float(capture.black_level.max())


def _check_dark(frame: Frame, capture: Capture, _dark: dict[str, float]) -> None:
    """Refuse a frame that is lit, or whose noise was cut off at zero."""
    lit = max(float(plane.mean()) for plane in _planes(capture)) / _range_dn(capture)
    if lit > MOST_DARK:
        raise DecodeError(
            f"{frame.path.name} is no dark frame: its mean lies at {lit:.0%} of white; cover the "
            "lens"
        )
    cut = float(np.mean(_plane_of(capture) == 0))
    if cut > MOST_CUT:
        raise DecodeError(
            f"{frame.path.name}: the camera cut {cut:.0%} of the samples off at 0, and half of "
            "the noise with them; it cannot be measured on such files"
        )


def _check_flat(frame: Frame, capture: Capture, dark: dict[str, float]) -> None:
    """Refuse a frame that is clipped or black in a colour."""
    limit = capture.saturated_rows(0, capture.height)
    saturated = limit if capture.cfa is not None else limit[:1]
    for dy in (0, 1):
        for dx in (0, 1):
            clipped = float(np.mean(saturated[..., dy::2, dx::2]))
            if clipped > MOST_CLIPPED:
                raise DecodeError(
                    f"{frame.path.name}: {clipped:.1%} of a colour is clipped; expose less"
                )
    for name, plane in zip(_names(capture), _planes(capture), strict=True):
        if float(plane.mean()) - dark[name] < LEAST_LIGHT * _range_dn(capture):
            raise DecodeError(
                f"{frame.path.name} is black in {name}: less than {LEAST_LIGHT:.1%} of white; "
                "expose longer"
            )


def _site(
    paths: tuple[Path, Path], planes: tuple[FloatGrid, FloatGrid], dark: float | None, step: float
) -> SitePair:
    statistics = site_pair(*planes, dark, step)
    if (
        dark is not None
        and abs((statistics.second_mean - dark) / (statistics.mean - dark) - 1) > MOST_DRIFT
    ):
        raise DecodeError(
            f"{paths[0].name} and {paths[1].name} differ by more than {MOST_DRIFT:.0%} in light: "
            "a pair is one light and one setting"
        )
    return statistics
