"""Pairs of dark and flat frames to the noise of a sensor at every ISO.

darks -> mean, variance, fixed pattern of each colour
flats -> variance over mean -> gain of each colour -> one gain
read noise = spread in the dark less rounding, times the gain
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.noise.frame_pairs import Pair, PairReader, in_pairs
from camkit.calibration.noise.rounding import LEAST_BOUND, OF_ROUNDING, Spread, spread_of
from camkit.calibration.noise.site import SitePair
from camkit.calibration.noise.transfer import Point, Transfer, fit_transfer
from camkit.errors import DecodeError
from camkit.progress import counted
from camkit.runtime.capture import MosaicOptions

LEAST_FLATS: Final = 2
FEW_FLATS: Final = 4
LEAST_TIMES: Final = 3
MUCH_PATTERN: Final = 0.05
MUCH_OFF: Final = 0.05
MUCH_APART: Final = 0.03
_SURE: Final = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class IsoFacts:
    """The measured noise at one ISO.

    Attributes:
        iso: Which.
        transfers: Name of each colour of the mosaic -> its line.
        gain_e_per_dn: Of all colours together.
        gain_error: Its standard deviation, as a share.
        read: Read noise in DN.
        black_level: Measured mean without light, in DN as stored.
        white_level: As stated.
        prnu: Spread of the pixels' response, as a share.
        dsnu_dn: Spread of the pixels' offsets, in DN.
        linearity: How far a mean lies at most from the exposure time times a constant, as a share;
            None where the files do not tell.
        pairs: Of flats.
        defects: Samples left out, as a share.
    """

    iso: float
    transfers: dict[str, Transfer]
    gain_e_per_dn: float
    gain_error: float
    read: Spread
    black_level: float
    white_level: float
    prnu: float
    dsnu_dn: float
    linearity: float | None
    pairs: int
    defects: float

    @property
    def read_noise_e(self) -> float:
        """Return the read noise, or its upper limit, in electrons."""
        return self.read.value * self.gain_e_per_dn

    def to_record(self) -> dict[str, Any]:
        """Return plain values; None where exposure times do not show linearity."""
        linearity = self.linearity
        return {
            "iso": _short(self.iso),
            "gain_e_per_dn": _short(self.gain_e_per_dn),
            "gain_error_percent": _short(100 * self.gain_error, 3),
            "read_noise_e": _short(self.read_noise_e),
            "read_noise_resolved": self.read.resolved,
            "full_well_e": _short(self.gain_e_per_dn * (self.white_level - self.black_level)),
            "black_level": round(self.black_level, 3),
            "white_level": float(self.white_level),
            "prnu_percent": _short(100 * self.prnu, 4),
            "dsnu_e": _short(self.dsnu_dn * self.gain_e_per_dn, 4),
            "linearity_percent": None if linearity is None else _short(100 * linearity, 3),
            "pairs": self.pairs,
            "defects_percent": _short(100 * self.defects, 3),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFacts:
    """The measured noise of a sensor.

    Attributes:
        camera: As the files name it; empty if they do not.
        isos: By increasing ISO.
        notes: What the user should know.
    """

    camera: str
    isos: tuple[IsoFacts, ...]
    notes: tuple[str, ...]

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "camera": self.camera,
            "notes": list(self.notes),
            "iso": [facts.to_record() for facts in self.isos],
        }


def measure_sensor(
    darks: Sequence[Path],
    flats: Sequence[Path],
    mosaic: MosaicOptions | None = None,
    iso: float | None = None,
) -> NoiseFacts:
    """Measure the noise of a sensor.

    Args:
        darks: Pairs of frames without light, a pair or more for every ISO.
        flats: Pairs of frames of even light, two levels or more for every ISO.
        mosaic: What files do not say of themselves.
        iso: For files that state none.

    Raises:
        ContractError: If a file is given twice.
        DecodeError: If files do not come in pairs, a frame cannot be read or used, or an ISO lacks
            its darks or flats.
    """
    dark_paths, flat_paths = in_pairs(darks, "darks"), in_pairs(flats, "flats")
    reader = PairReader(mosaic, iso)
    dark_pairs = _by_iso(
        reader.dark(paths) for paths in counted(dark_paths, "reading darks", "pairs")
    )
    means = {at: _means(pairs) for at, pairs in dark_pairs.items()}
    flat_pairs = _by_iso(
        reader.flat(paths, means) for paths in counted(flat_paths, "reading flats", "pairs")
    )
    for at in dark_pairs:
        count = len(flat_pairs.get(at, ()))
        if count < LEAST_FLATS:
            raise DecodeError(
                f"ISO {at:g} has {count} pairs of flats; give {LEAST_FLATS} or more at levels "
                "that differ"
            )
    isos = tuple(_iso_facts(dark_pairs[at], flat_pairs[at]) for at in sorted(dark_pairs))
    like = next(iter(dark_pairs.values()))[0].first.like
    notes = [note for facts in isos for note in _notes(facts)]
    return NoiseFacts(camera=like.camera, isos=isos, notes=tuple(notes))


def _by_iso(pairs: Iterable[Pair]) -> dict[float, list[Pair]]:
    by_iso: dict[float, list[Pair]] = {}
    for pair in pairs:
        by_iso.setdefault(pair.iso, []).append(pair)
    return by_iso


def _means(darks: Sequence[Pair]) -> dict[str, float]:
    """Return the mean of each colour in the dark, in DN above the stated black."""
    return {
        name: float(np.mean([(p.sites[name].mean + p.sites[name].second_mean) / 2 for p in darks]))
        for name in darks[0].sites
    }


def _iso_facts(darks: Sequence[Pair], flats: Sequence[Pair]) -> IsoFacts:
    step = float(np.gcd.reduce([pair.step for pair in flats]) or 1)
    black = _means(darks)
    in_dark = {name: [pair.sites[name] for pair in darks] for name in black}
    every = [site for sites in in_dark.values() for site in sites]
    read = _read_noise(every, step)
    transfers = {}
    for name, sites in in_dark.items():
        points = [_point(pair.sites[name]) for pair in flats]
        dark = _joined(sites) if read.resolved else _hidden_dark(step)
        transfers[name] = fit_transfer(points, dark)
    gain, error = _one_gain(list(transfers.values()))
    dark_pattern = float(np.mean([site.pattern for site in every]))
    like = flats[0].first.like
    all_sites = [*every, *(site for pair in flats for site in pair.sites.values())]
    return IsoFacts(
        iso=flats[0].iso,
        transfers=transfers,
        gain_e_per_dn=gain,
        gain_error=error,
        read=read,
        black_level=float(like.black_level.mean()) + float(np.mean(list(black.values()))),
        white_level=like.white_level,
        prnu=_prnu([s for p in flats for s in p.sites.values()], dark_pattern),
        dsnu_dn=float(np.sqrt(max(dark_pattern, 0))),
        linearity=_linearity(flats, black),
        pairs=len(flats),
        defects=sum(s.defects for s in all_sites) / sum(s.samples + s.defects for s in all_sites),
    )


def _read_noise(darks: Sequence[SitePair], step: float) -> Spread:
    samples = sum(site.samples for site in darks)
    variance = sum(site.variance * site.samples for site in darks) / samples
    return spread_of(variance, samples, step)


def _point(site: SitePair) -> Point:
    return Point(signal=site.signal, variance=site.variance, samples=site.samples)


def _joined(darks: Sequence[SitePair]) -> Point:
    return Point(
        signal=0.0,
        variance=float(np.mean([site.variance for site in darks])),
        samples=sum(site.samples for site in darks),
    )


def _hidden_dark(step: float) -> Point:
    """Return the noise that rounding hides in dark frames, and its standard error.

    It is rounding, smeared by the shot noise, and anything up to the square of the bound.
    """
    most = LEAST_BOUND**2
    variance, spread = OF_ROUNDING + most / 2, most / np.sqrt(12)
    return Point(
        signal=0.0,
        variance=variance * step**2,
        samples=round(2 * float(variance / spread) ** 2),
    )


def _one_gain(transfers: Sequence[Transfer]) -> tuple[float, float]:
    """Return the gain of all colours, and its error as a share: theirs, or what sets them apart."""
    slopes = np.array([line.dn_per_e for line in transfers])
    weight = 1 / np.array([max(line.error, 1e-12) for line in transfers]) ** 2
    slope = float(weight @ slopes / weight.sum())
    errors = [1 / float(np.sqrt(weight.sum()))]
    if slopes.size > 1:
        errors.append(float(slopes.std(ddof=1) / np.sqrt(slopes.size)))
    return 1 / slope, max(errors) / slope


def _prnu(flats: Sequence[SitePair], dark_pattern: float) -> float:
    """Return the response's spread: fixed pattern less that of the dark, over squared light.

    References: EMVA 1288 release 4.0, eq. (63).
    """
    lit, pattern, noise, samples = (
        np.array([getattr(site, name) for site in flats])
        for name in ("lit", "pattern", "variance", "samples")
    )
    squared = lit**2
    weight = samples / np.maximum(noise, 1e-12) ** 2
    share = float((weight * squared) @ (pattern - dark_pattern) / ((weight * squared) @ squared))
    return float(np.sqrt(max(share, 0.0)))


def _linearity(flats: Sequence[Pair], black: dict[str, float]) -> float | None:
    """Return the deviation of means from exposure times a constant; None without times."""
    stated_times = [pair.first.time_s for pair in flats]
    times = np.array([time for time in stated_times if time is not None])
    if len(times) < len(stated_times) or np.unique(times).size < LEAST_TIMES:
        return None
    means: NDArray[np.float64] = np.array(
        [
            np.mean([(s.mean + s.second_mean) / 2 - black[name] for name, s in pair.sites.items()])
            for pair in flats
        ]
    )
    rates = means / times
    return float(np.abs(rates / rates.mean() - 1).max())


def _notes(facts: IsoFacts) -> list[str]:
    at, notes = f"ISO {facts.iso:g}", []
    if not facts.read.resolved:
        notes.append(
            f"{at}: the read noise is finer than the converter's step; it lies below "
            f"{facts.read_noise_e:.3g} e-"
        )
    if facts.pairs < FEW_FLATS:
        notes.append(f"{at}: only {facts.pairs} levels of light; give {FEW_FLATS} or more")
    if facts.prnu > MUCH_PATTERN:
        notes.append(
            f"{at}: the flats hold a pattern of {facts.prnu:.0%}: is there something sharp in them?"
        )
    slopes = np.array([line.dn_per_e for line in facts.transfers.values()])
    errors = np.array([line.error for line in facts.transfers.values()])
    deviations = np.abs(slopes * facts.gain_e_per_dn - 1)
    if (deviations > np.maximum(MUCH_APART, _SURE * errors * facts.gain_e_per_dn)).any():
        listed = ", ".join(f"{n} {1 / t.dn_per_e:.3g}" for n, t in facts.transfers.items())
        notes.append(f"{at}: the colours differ in gain: {listed} e-/DN")
    misfit = max(float(np.abs(line.misfits()).max()) for line in facts.transfers.values())
    if misfit > MUCH_OFF:
        notes.append(
            f"{at}: a level lies {misfit:.0%} off the line of photon transfer; the sensor is not "
            "linear there, or the light changed"
        )
    return notes


def _short(value: float, digits: int = 5) -> float:
    return float(f"{value:.{digits}g}")
