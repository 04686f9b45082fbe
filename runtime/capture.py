"""A capture: the linear samples of one photograph in sensor orientation, with what is known of it.

The samples stay as the file stores them (24 megapixels of uint16 are 48 MB); rows become float32
when a stage asks for them.
"""

import math
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray, InputContract
from camkit.caller import option_text
from camkit.cfa import CFA_PATTERNS, CfaPattern
from camkit.errors import ContractError
from camkit.field_types import check_fields
from camkit.noise import NoiseModel
from camkit.picture_window import PictureWindow
from camkit.runtime.binning import Binning
from camkit.runtime.machine.memory import mapping_of
from camkit.runtime.metadata import Metadata

if TYPE_CHECKING:
    from camkit.bundle.plane import Plane
    from camkit.runtime.rows import Rows, RowSource

SATURATION_SHARE: Final = 0.99
"""A sample at this share of the white level is taken as clipped.

Cameras clip a little below or above the stated white level (gain calibration, linearisation
tables, companding; the spread seen is under one percent). A sharp sample called clipped by
mistake costs one interpolated highlight, a clipped one called sharp costs a ringing halo.
"""

COLOURS: Final = 3
_SAMPLE_TYPES: Final = (np.uint8, np.uint16, np.float32)


MAX_ISO: Final = 1e7
"""Twice the largest that any camera offers."""

BRIGHTEST: Final = 1e6
"""In white levels; float samples beyond, as files hold them where nothing was computed, count as
invalid: twenty stops above white no sample is light."""


def check_iso(iso: Any) -> None:
    """Refuse a sensitivity that no camera has.

    Raises:
        ContractError: If it is neither None nor a number that can be.
    """
    number: Any = iso if isinstance(iso, Real) else math.nan
    if iso is not None and not 0 < number <= MAX_ISO:
        raise ContractError(f"iso must be a number in 0..{MAX_ISO:g}; got {repr(iso)[:20]}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MosaicOptions:
    """The caller's facts of a mosaic: all of a headerless one, or the levels of a RAW.

    Attributes:
        cfa: Letters of the 2x2 cell at pixel (0, 0) in reading order, for a headerless mosaic
            (single-channel PNG or TIFF); None for a RAW file, which says it itself.
        black_level: Stored value without light; None for what the RAW file says.
        white_level: Stored value at saturation; None for what the RAW file says.
    """

    cfa: CfaPattern | None = None
    black_level: float | None = None
    white_level: float | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        black, white = self.black_level, self.white_level
        if self.cfa is not None and (black is None or white is None):
            raise ContractError(
                f"a headerless mosaic needs {option_text('cfa')}, {option_text('black_level')} and "
                f"{option_text('white_level')}"
            )
        lower = 0.0 if black is None else black
        if not 0 <= lower < (np.inf if white is None else white) or white == np.inf:
            levels = (("black", black), ("white", white))
            text = ", ".join(f"{name} {value}" for name, value in levels if value is not None)
            raise ContractError(f"levels must be 0 <= black < white; got {text}")

    @property
    def levels(self) -> frozenset[str]:
        """Name the levels that are said: "black", "white"."""
        levels = {"black": self.black_level, "white": self.white_level}
        return frozenset(name for name, level in levels.items() if level is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Capture:
    """One photograph as the sensor saw it.

    Attributes:
        samples: (h, w) mosaic or (c, h, w) planes; uint8, uint16 or float32, in file units.
        cfa: Letters of the 2x2 cell at pixel (0, 0); None for planes.
        black_level: float32 in file units: (2, 2) by position in the cell for a mosaic, (c,) for
            planes.
        white_level: Saturation in file units.
        white_balance: Gains (R, G, B) of the camera's own choice, G = 1; None if not stated.
        color_matrix: (3, 3) float64, XYZ (D65) to camera; None if not stated.
        orientation: EXIF orientation 1..8; the samples themselves are never turned.
        iso: ISO speed of the samples, which tells their noise; None if not stated.
        exposure_time_s: Exposure time; None if not stated.
        noise: Noise of the linear signal (1.0 = white level) before white balance.
        origin_px: (x, y) of the top-left pixel on the full sensor; None if not stated.
        sensor_size_px: (w, h) of the full sensor that `origin_px` refers to.
        pixel_pitch_um: Pixel pitch; None if not stated.
        bundle_name: The bundle that the file itself names (captures made by camkit).
        psf_sha256: Hash of that bundle's PSF, which tells bundles of one name apart; None if not
            stated.
        camera: Make and model as people read it; empty if not stated.
        metadata: What the file says of its photograph, to be carried into pictures.
        sha256: Hash of the file; None for arrays.
        window: Where the samples lie in a larger picture; None if the format knows no such thing.
        binning: Squares of the sensor's mosaic that the samples are means over; None for the
            sensor's own samples. Place and pitch are those of the mosaic.
        rounding: Of samples that were codes of few bits: (2, n) light, and the variance that
            rounding to codes has there; None for others.
        notes: What a person should know of this decode.
        decoder_peak_mb: Peak memory of the process that decoded; 0 where it was this one.
    """

    samples: NDArray[Any]
    cfa: CfaPattern | None
    black_level: FloatArray
    white_level: float
    white_balance: tuple[float, float, float] | None = None
    color_matrix: NDArray[np.float64] | None = None
    orientation: int = 1
    iso: float | None = None
    exposure_time_s: float | None = None
    noise: NoiseModel | None = None
    origin_px: tuple[int, int] | None = None
    sensor_size_px: tuple[int, int] | None = None
    pixel_pitch_um: float | None = None
    bundle_name: str | None = None
    psf_sha256: str | None = None
    camera: str = ""
    metadata: Metadata = field(default_factory=Metadata)
    sha256: str | None = None
    window: PictureWindow | None = None
    binning: Binning | None = None
    rounding: FloatArray | None = None
    notes: tuple[str, ...] = ()
    decoder_peak_mb: float = field(default=0.0, compare=False)

    def __post_init__(self) -> None:
        self._check_samples()
        self._check_levels()
        self._check_color()
        check_iso(self.iso)
        if self.orientation not in range(1, 9):
            raise ContractError(f"orientation must be an EXIF number 1..8; got {self.orientation}")

    def _check_samples(self) -> None:
        shape = self.samples.shape
        if self.samples.dtype not in _SAMPLE_TYPES:
            raise ContractError(
                f"samples must be uint8, uint16 or float32; got {self.samples.dtype}"
            )
        mosaic = self.cfa is not None
        if self.cfa is not None and self.cfa not in CFA_PATTERNS:
            raise ContractError(f"CFA must be one of {CFA_PATTERNS}; got {self.cfa!r}")
        if len(shape) != (2 if mosaic else 3):
            expected = "(h, w) for a mosaic" if mosaic else "(c, h, w) for planes (cfa is None)"
            raise ContractError(f"samples must be {expected}; got {shape}")
        if 0 in shape:
            raise ContractError(f"samples must not be empty; got {shape}")

    def _check_levels(self) -> None:
        shape = (self.samples.shape[0],) if self.cfa is None else (2, 2)
        black = self.black_level
        if black.shape != shape or black.dtype != np.float32 or not np.isfinite(black).all():
            raise ContractError(
                f"black level must be finite float32 {shape}; got {black.dtype} {black.shape}"
            )
        if not (np.isfinite(self.white_level) and self.white_level > black.max()):
            raise ContractError(
                f"white level must lie above black {black.max():g}; got {self.white_level:g}"
            )

    def _check_color(self) -> None:
        gains = self.white_balance
        if gains is not None and not (
            len(gains) == 3 and np.isfinite(gains).all() and min(gains) > 0 and gains[1] == 1
        ):
            raise ContractError(f"white balance must be 3 gains > 0 with G = 1; got {gains}")
        matrix = self.color_matrix
        if matrix is not None and (matrix.shape != (3, 3) or not np.isfinite(matrix).all()):
            raise ContractError(f"color matrix must be finite (3, 3); got {matrix.shape}")

    @property
    def gives_own_rows(self) -> bool:
        """Return whether what `rows` reads is the reader's own: it is a view of the samples."""
        return False

    @property
    def is_of_mosaic(self) -> bool:
        """Return whether a mosaic recorded the light: its colours and levels are a sensor's."""
        return self.cfa is not None or self.binning is not None

    @property
    def contract(self) -> InputContract:
        """Name the input of bundles that this capture is."""
        if self.cfa is not None:
            return "raw_bayer_v1"
        return "linear_rgb_v1" if self.channels == COLOURS else "linear_planes_v1"

    @property
    def channels(self) -> int:
        """Return the number of colours: of the planes, or of those behind the mosaic."""
        return int(self.samples.shape[0]) if self.cfa is None else COLOURS

    @property
    def plane_shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w) of the samples; a mosaic is one channel."""
        return 1 if self.cfa is not None else self.channels, self.height, self.width

    def plane(self, sensor_plane: "Plane | None") -> "Plane":
        """Return what the samples are.

        Args:
            sensor_plane: The plane of a bundle's sensor; planes that come in place of a mosaic have
                their own channels.
        """
        # the process of the decoder, which is started for every file, needs no manifest
        from camkit.bundle.plane import Plane
        from camkit.bundle.sensor import MOSAIC, RGB

        channels = MOSAIC if self.cfa is not None else RGB
        if sensor_plane is None:
            return Plane(type="uint16", channels=channels, domain="dn")
        if self.cfa is None and sensor_plane.channels == MOSAIC:
            return sensor_plane.model_copy(update={"channels": RGB})
        return sensor_plane

    def rows(self) -> "RowSource":
        """Return the samples as the file holds them."""
        return _Samples(self)

    def gives(self, _plane: "Plane") -> bool:
        """Return whether a plane can be a product of this capture: any can."""
        return True

    def shares_memory(self, array: NDArray[Any]) -> bool:
        """Return whether an array may lie where the samples do."""
        return bool(np.may_share_memory(array, self.samples))

    def close(self) -> None:
        """Release the file: it was read whole."""

    @property
    def height(self) -> int:
        """Return the number of rows."""
        return int(self.samples.shape[-2])

    @property
    def width(self) -> int:
        """Return the number of columns."""
        return int(self.samples.shape[-1])

    @property
    def resident_bytes(self) -> int:
        """Return the memory that the samples take; none where they are read from the file."""
        return 0 if mapping_of(self.samples) is not None else self.samples.nbytes

    def linear_rows(self, top: int, bottom: int) -> FloatArray:
        """Return rows top..bottom as a linear signal: black is 0, white level 1, negatives kept.

        Float samples that are infinite or beyond `BRIGHTEST` are NaN, as invalid ones are.

        Returns:
            (bottom - top, w) float32 for a mosaic, (c, bottom - top, w) for planes.

        Raises:
            ContractError: If the rows lie outside the picture.
        """
        self._check_rows(top, bottom)
        rows = self.samples[..., top:bottom, :].astype(np.float32, order="C")
        if np.issubdtype(self.samples.dtype, np.floating):
            rows[~(np.abs(rows) <= BRIGHTEST * self.white_level)] = np.nan
        black = self._black_rows(top)
        scale = np.float32(1) / (np.float32(self.white_level) - black)
        if self.cfa is None or (black == black[0, 0]).all():
            rows -= black if self.cfa is None else black[0, 0]
            rows *= scale if self.cfa is None else scale[0, 0]
            return rows
        for dy in (0, 1):
            for dx in (0, 1):
                rows[dy::2, dx::2] -= black[dy, dx]
                rows[dy::2, dx::2] *= scale[dy, dx]
        return rows

    def saturated_rows(self, top: int, bottom: int) -> NDArray[np.bool_]:
        """Return which samples of rows top..bottom are clipped (see `SATURATION_SHARE`).

        Float planes have no white level that clips, so none of their samples is; a float mosaic
        is in the numbers of its sensor, which does clip.

        Returns:
            bool of the shape of `linear_rows`.
        """
        self._check_rows(top, bottom)
        rows = self.samples[..., top:bottom, :]
        if self.cfa is None and np.issubdtype(rows.dtype, np.floating):
            return np.zeros(rows.shape, dtype=bool)
        black = self._black_rows(top)
        limit = black + SATURATION_SHARE * (np.float32(self.white_level) - black)
        if self.cfa is None:
            return np.asarray(rows >= np.ceil(limit))
        if np.issubdtype(rows.dtype, np.integer):
            limit = np.ceil(limit).astype(np.int64)  # compared in the type of the samples
        if (limit == limit[0, 0]).all():
            return np.asarray(rows >= limit[0, 0].item())
        clipped = np.empty(rows.shape, dtype=bool)
        for dy in (0, 1):
            for dx in (0, 1):
                clipped[dy::2, dx::2] = rows[dy::2, dx::2] >= limit[dy, dx].item()
        return clipped

    def _black_rows(self, top: int) -> FloatArray:
        """Return black as (c, 1, 1), or as the (2, 2) cell that starts at row `top`."""
        if self.cfa is None:
            return self.black_level[:, None, None]
        return np.roll(self.black_level, -(top % 2), axis=0)

    def _check_rows(self, top: int, bottom: int) -> None:
        if not 0 <= top <= bottom <= self.height:
            raise ContractError(f"rows must lie in 0..{self.height}; got {top}..{bottom}")


class _Samples:
    """The samples of a capture as rows."""

    def __init__(self, capture: Capture) -> None:
        self._capture = capture

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w); a mosaic is one channel."""
        return self._capture.plane_shape

    def read(self, top: int, bottom: int) -> "Rows":
        """Return rows top..bottom."""
        rows: Rows = self._capture.samples[..., top:bottom, :]
        return rows if rows.ndim == 3 else rows[None]
