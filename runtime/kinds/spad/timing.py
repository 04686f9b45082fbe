"""The times of a capture: a strict TOML file, and what the capture itself states.

[timing]      orientation = "gate" | "histogram"
              time_bin_ps or bin_edges_ps, first_ps (centre of bin 0; delay of the first gate),
              bins, cycles (laser cycles per bin; 0: unknown, pile-up is left as it is)
[gate]        width_ps, rc_ps, jitter_ps (standard deviation)
[laser]       fwhm_ps (full width), wavelength_nm
[irf]         file: two columns, times in ps and values; mu is where the time is 0
[array]       axes, key, stamp_ps, pitch_um, focal_length_mm, bundle (the camera)
[lifetime]    period_ps (of the laser, where what it excited before is still seen), from_ps, to_ps
              (bins that are fitted); for the product lifetime alone
[correction]  offset_ps, dark (counts of a bin: a number, or an .npy map), hot (an .npy map)
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.containers.stored_array import read_columns, read_map
from camkit.runtime.kinds.spad.pulse import (
    FWHM_PER_SIGMA,
    GatedPulse,
    GaussianPulse,
    Pulse,
    SampledPulse,
)
from camkit.runtime.kinds.spad.time_axis import Orientation, TimeAxis
from camkit.side_file import read_side_toml

LIGHT_M_PER_PS: Final = 299_792_458e-12
Positive = Annotated[float, Field(gt=0, lt=1e15)]
Edges = Annotated[tuple[float, ...], Field(max_length=100_000, strict=False)]
NotNegative = Annotated[float, Field(ge=0, lt=1e15)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Times(_Table):
    """The time axis; see the module."""

    orientation: Orientation | None = None
    time_bin_ps: Positive | None = None
    bin_edges_ps: Edges | None = None
    first_ps: float | None = None
    bins: Annotated[int, Field(ge=1, le=100_000)] | None = None
    cycles: Annotated[int, Field(ge=0)] = 0


class Gate(_Table):
    """The gate of the detector; without a width its jitter alone counts."""

    width_ps: Positive | None = None
    rc_ps: NotNegative = 0.0
    jitter_ps: NotNegative = 0.0


class Laser(_Table):
    """The pulse of light."""

    fwhm_ps: NotNegative = 0.0
    wavelength_nm: Positive | None = None


class Irf(_Table):
    """A pulse that was measured, in place of gate and laser."""

    file: str | None = None


class Array(_Table):
    """The layout of the capture's array, and the directions of its pixels."""

    axes: str | None = None
    key: str | None = None
    stamp_ps: Positive | None = None
    pitch_um: Positive | None = None
    focal_length_mm: Positive | None = None
    bundle: str | None = None


class Lifetime(_Table):
    """The known facts for fits of lifetimes."""

    period_ps: Positive | None = None
    from_ps: float | None = None
    to_ps: float | None = None


class Correction(_Table):
    """The corrections of counts, and the pixels that are left out."""

    offset_ps: float = 0.0
    dark: NotNegative | str = 0.0
    hot: str | None = None


class Timing(_Table):
    """All that is known of the times of a capture.

    Attributes:
        folder: Where files that it names are looked for.
    """

    timing: Times = Times()
    gate: Gate = Gate()
    laser: Laser = Laser()
    irf: Irf = Irf()
    array: Array = Array()
    lifetime: Lifetime = Lifetime()
    correction: Correction = Correction()
    folder: Path = Field(default=Path(), exclude=True)

    def axis(self, *, orientation: Orientation | None = None, bins: int | None = None) -> TimeAxis:
        """Return the time axis of a capture.

        Args:
            orientation: What such captures are unless something else is stated.
            bins: How many the capture has; None where that must be stated.

        Raises:
            ContractError: If something is missing, or stated and counted bins differ.
        """
        times = self.timing
        axis_orientation = times.orientation or orientation
        if axis_orientation is None:
            raise ContractError(
                f"{_bins_text(bins)}nothing says whether times are those of a gate or of a "
                'histogram; state [timing] orientation = "gate" or "histogram" in a file for '
                f"{option_text('timing')}"
            )
        edges = times.bin_edges_ps
        stated_bins = times.bins if edges is None else len(edges) - 1
        if bins is not None and stated_bins is not None and bins != stated_bins:
            raise ContractError(
                f"the capture has {bins} time bins, [timing] states {stated_bins}; correct bins, "
                "or [array] axes if time is another axis"
            )
        if edges is not None:
            _only_edges(times)
            return TimeAxis(
                orientation=axis_orientation, edges_ps=np.array(edges, dtype=np.float64)
            )
        if times.time_bin_ps is None:
            raise ContractError(
                f"{_bins_text(bins)}nothing says how wide a time bin is; state [timing] "
                f"time_bin_ps (or bin_edges_ps) in a file for {option_text('timing')}"
            )
        count = bins if bins is not None else stated_bins
        if count is None:
            raise ContractError("time stamps need [timing] bins: how many time bins to sort into")
        return TimeAxis.regular(
            axis_orientation,
            bins=count,
            time_bin_ps=times.time_bin_ps,
            first_ps=times.first_ps or 0.0,
        )

    def pulse(self) -> Pulse | None:
        """Return the pulse that is stated; None if none is.

        Raises:
            ContractError: If a measured one cannot be read, or two are stated.
        """
        sigma = float(np.hypot(self.gate.jitter_ps, self.laser.fwhm_ps / FWHM_PER_SIGMA))
        if self.irf.file is not None:
            if self.gate.width_ps is not None or sigma > 0:
                raise ContractError(
                    "[irf] file stands for gate and laser together; leave [gate] and fwhm_ps out"
                )
            times, values = read_columns(self.folder / self.irf.file, "the measured pulse")
            return SampledPulse(times_ps=times, values=values)
        if self.gate.width_ps is not None:
            return GatedPulse(width_ps=self.gate.width_ps, rc_ps=self.gate.rc_ps, sigma_ps=sigma)
        if self.gate.rc_ps > 0:
            raise ContractError("[gate] rc_ps is of the edges of a gate; state its width_ps too")
        return GaussianPulse(sigma_ps=sigma) if sigma > 0 else None

    def dark(self, shape: tuple[int, int]) -> NDArray[np.float64]:
        """Return the dark counts of a bin, (h, w).

        Raises:
            ContractError: If the map cannot be read, is of another size, or negative.
        """
        dark = self.correction.dark
        if not isinstance(dark, str):
            return np.full(shape, dark)
        dark_map = read_map(self.folder / dark, "the map of dark counts").astype(np.float64)
        _check_map(dark_map, shape, "dark counts")
        if (dark_map < 0).any():
            raise ContractError(
                f"the map of dark counts holds negative numbers, down to {dark_map.min():g}; "
                "expected counts >= 0"
            )
        return dark_map

    def hot(self, shape: tuple[int, int]) -> NDArray[np.bool_]:
        """Return the pixels that are stated to be hot, (h, w).

        Raises:
            ContractError: If the map cannot be read or is of another size.
        """
        if self.correction.hot is None:
            return np.zeros(shape, dtype=bool)
        hot_map = read_map(self.folder / self.correction.hot, "the map of hot pixels")
        _check_map(hot_map, shape, "hot pixels")
        return np.asarray(hot_map != 0)

    @property
    def files(self) -> list[Path]:
        """Name the files that it names."""
        dark = self.correction.dark
        names = (self.irf.file, dark if isinstance(dark, str) else None, self.correction.hot)
        return [self.folder / name for name in names if name is not None]

    def with_stated(self, values: Mapping[str, object]) -> "Timing":
        """Return it with what a capture states of itself, where it says nothing.

        Raises:
            ContractError: If the capture states what cannot be.
        """
        tables: dict[str, dict[str, Any]] = self.model_dump(exclude_unset=True)
        if {"time_bin_ps", "bin_edges_ps"} & set(tables.get("timing", {})):
            theirs = {"time_bin_ps", "bin_edges_ps"}
            theirs |= {"first_ps"} if self.timing.bin_edges_ps is not None else set()
            values = {name: value for name, value in values.items() if name not in theirs}
        for name, value in values.items():
            if name in TABLE_OF:
                table = tables.setdefault(TABLE_OF[name], {})
                table.setdefault(name, _plain(name, value))
        return _checked(tables, self.folder, "what the capture states of itself")


TABLES: Final[Mapping[str, type[_Table]]] = {
    "timing": Times,
    "gate": Gate,
    "laser": Laser,
    "irf": Irf,
    "array": Array,
    "lifetime": Lifetime,
    "correction": Correction,
}
TABLE_OF: Final[Mapping[str, str]] = {
    name: table
    for table, kind in TABLES.items()
    for name in kind.model_fields
    if name not in {"file", "axes", "key", "bundle", "hot", "dark"}
}
"""Names that a capture may state of itself -> their tables."""
WHOLE: Final = frozenset({"bins", "cycles"})
"""Names of whole numbers."""


def timing_beside(capture: Path) -> Path:
    """Return the path of the timing file that may lie beside a capture: NAME.TYPE.toml."""
    return capture.with_name(capture.name + ".toml")


def read_timing(path: Path) -> Timing:
    """Read a timing file.

    Raises:
        ContractError: If it is missing, no TOML, or a name or value in it is none.
    """
    return _checked(read_side_toml(path, "timing"), path.parent, f"timing {path}")


def _plain(name: str, value: object) -> object:
    """Return a stated value as TOML would; most files know no whole numbers, only floats."""
    if isinstance(value, np.ndarray | np.generic):
        value = np.asarray(value).tolist()
    if name in WHOLE and isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def _checked(tables: Mapping[str, Any], folder: Path, what: str) -> Timing:
    if unknown := sorted(set(tables) - set(TABLES)):
        raise ContractError(f"{what}: [{unknown[0]}]: is unknown; known are {', '.join(TABLES)}")
    try:
        return Timing.model_validate({**tables, "folder": folder})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = [str(part) for part in first["loc"]]
        if first["type"] == "extra_forbidden":
            text = f"is unknown; known are {', '.join(TABLES[place[0]].model_fields)}"
        else:
            text = f"{first['msg'][0].lower()}{first['msg'][1:]}; got {first['input']!r:.60}"
        name = f"[{place[0]}] {' '.join(place[1:2])}".rstrip()
        raise ContractError(f"{what}: {name}: {text}") from error


def _bins_text(bins: int | None) -> str:
    return "" if bins is None else f"the capture has {bins} time bins, and "


def _only_edges(times: Times) -> None:
    extra = [name for name in ("time_bin_ps", "first_ps") if getattr(times, name) is not None]
    if extra:
        raise ContractError(
            f"[timing] bin_edges_ps says where every bin lies; leave {' and '.join(extra)} out"
        )


def _check_map(values: NDArray[Any], shape: tuple[int, int], what: str) -> None:
    if values.shape != shape:
        raise ContractError(
            f"the map of {what} is {values.shape[1]}x{values.shape[0]}, the capture "
            f"{shape[1]}x{shape[0]}"
        )
