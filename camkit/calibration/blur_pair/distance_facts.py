"""The facts that two pictures of one plane show of a lens, and the sentence that sums them up."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from camkit.calibration.blur_pair.blur_errors import BlurErrors, gain_db
from camkit.calibration.blur_pair.blur_search import SearchResult
from camkit.calibration.blur_pair.registration import Registration

SURE: Final = 2.0
"""Standard errors by which one origin must be better than another."""
ALIKE_DB: Final = 0.1
"""Origins that differ less once the sensor may move explain pictures equally well."""
MATTERS_DB: Final = 0.1
"""Gain from which on a defocus is passed on."""
LEAST_ERROR_MM: Final = 1e-4
NAMES: Final = {"vertex": "the first vertex", "sensor": "the sensor", "pupil": "the pupil"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlurRow:
    """One blur and how well it predicts the wide picture.

    Attributes:
        name: Of the blur.
        setting: What was fitted, for people.
        errors: Of the prediction.
    """

    name: str
    setting: str
    errors: BlurErrors

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {"blur": self.name, "setting": self.setting, **self.errors.to_record()}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane:
    """One pair of pictures.

    Attributes:
        object_m: Distance of the plane, as stated.
        registration: Of the sharp picture in the wide one.
        disc_px: Diameter of the disc that fits best.
        share: Of the frame that counts.
    """

    object_m: float
    registration: Registration
    disc_px: float
    share: float

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "object_m": self.object_m,
            "disc_px": round(self.disc_px, 3),
            "share": round(self.share, 4),
            **self.registration.to_record(),
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DistanceFacts:
    """The result of comparing pictures of planes.

    Attributes:
        fits: Origin -> defocus fitted, in mm; the start is the sensor in best focus.
        tone: The curve that explains them best.
        tones_db: Curve -> PSNR of the best prediction.
        rows: Blurs compared, by that curve.
        planes: The pairs.
        tolerance_mm: Defocus that changes the blur by a pixel: no camera is focused better.
        notes: What the user should know.
    """

    fits: Mapping[str, SearchResult]
    tone: str
    tones_db: Mapping[str, float]
    rows: tuple[BlurRow, ...]
    planes: tuple[Plane, ...]
    tolerance_mm: float
    notes: tuple[str, ...] = ()

    @property
    def alike(self) -> tuple[str, ...]:
        """Return the origins that explain the pictures equally well once the sensor may move.

        The first one needs it least: it is the best with the sensor in best focus.
        """
        best = max(self.fits.values(), key=lambda fit: fit.errors.psnr_db()).errors
        gains = {name: gain_db(best, fit.errors) for name, fit in self.fits.items()}
        alike = [n for n, (gain, error) in gains.items() if gain < max(ALIKE_DB, SURE * error)]
        return tuple(sorted(alike, key=lambda name: -self.fits[name].start.psnr_db()))

    @property
    def origin(self) -> str:
        """Return what distances count from, as far as the pictures show it."""
        return self.alike[0]

    @property
    def is_sure(self) -> bool:
        """Return whether no other origin explains the pictures with a defocus that can be."""
        return all(abs(self.fits[o].best) > self.tolerance_mm for o in self.alike[1:])

    @property
    def fit(self) -> SearchResult:
        """Return the defocus from that origin."""
        return self.fits[self.origin]

    @property
    def options(self) -> dict[str, str | float]:
        """Return what to pass on to `make` and `recipe`."""
        return self.options_of(self.origin)

    def options_of(self, origin: str) -> dict[str, str | float]:
        """Return what to pass on if distances count from an origin."""
        fit = self.fits[origin]
        options: dict[str, str | float] = {"distance_from": origin}
        gain, error = gain_db(fit.errors, fit.start)
        if gain > max(MATTERS_DB, SURE * error):
            digits = math.ceil(-math.log10(max(fit.error, LEAST_ERROR_MM)))
            options["defocus_mm"] = round(fit.best, digits)
        return options

    @property
    def sentence(self) -> str:
        """Return the result in words."""
        fit = self.fit
        others = sorted(
            (o for o in self.fits if o != self.origin), key=lambda o: -self.fits[o].start.psnr_db()
        )
        rest = [f"from {NAMES[o]} {self.fits[o].start.psnr_db():.1f}" for o in others]
        decibels = "; ".join([f"{fit.start.psnr_db():.1f} dB in best focus", *rest[:1]])
        decibels = ", ".join([decibels, *rest[1:]])
        begin = "distances count from" if self.is_sure else "distances may count from"
        return (
            f"{begin} {NAMES[self.origin]} ({decibels}); sensor {fit.best:+.3f} +- "
            f"{fit.error:.3f} mm from best focus; curve {self.tone}"
        )

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return what the pictures leave open."""
        doubts = []
        first, *others = self.alike
        if others:
            ways = [
                f"{NAMES[o]} with {self.fits[o].best:+.3f} +- {self.fits[o].error:.3f} mm "
                f"({self.fits[o].errors.psnr_db():.2f} dB)"
                for o in others
            ]
            advice = "" if self.is_sure else f"; {_advice(self.planes)}"
            doubts.append(
                f"from {NAMES[first]} with the sensor moved by {self.fits[first].best:+.3f} mm: "
                f"{self.fits[first].errors.psnr_db():.2f} dB; equally well from "
                f"{' or from '.join(ways)}{advice}"
            )
        if not self.fit.is_bracketed:
            doubts.append("no end of the defocus was found; check focus, distance and stops")
        ranked = sorted(self.tones_db, key=lambda name: -self.tones_db[name])
        if len(ranked) > 1:
            every = ", ".join(f"{name} {self.tones_db[name]:.2f}" for name in ranked)
            doubts.append(f"by tone curve, dB: {every}")
        return tuple(doubts)

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "sentence": self.sentence,
            "distance_from": self.origin,
            "is_sure": self.is_sure,
            "alike": list(self.alike),
            "defocus_mm": round(self.fit.best, 4),
            "defocus_error_mm": round(self.fit.error, 4),
            "defocus_halves_mm": [round(value, 4) for value in self.fit.halves],
            "defocus_colours_mm": [round(value, 4) for value in self.fit.colours],
            "tone": self.tone,
            "options": self.options,
            "notes": [*self.notes, *self.doubts],
            "planes": [plane.to_record() for plane in self.planes],
            "tones": [{"tone": n, "psnr_db": round(v, 3)} for n, v in self.tones_db.items()],
            "origins": [
                {
                    "distance_from": name,
                    "in_focus_db": round(fit.start.psnr_db(), 3),
                    "moved_db": round(fit.errors.psnr_db(), 3),
                    "defocus_mm": round(fit.best, 4),
                    "defocus_error_mm": round(fit.error, 4),
                }
                for name, fit in self.fits.items()
            ],
            "blurs": [row.to_record() for row in self.rows],
        }


def _advice(planes: tuple[Plane, ...]) -> str:
    """Return what would decide."""
    if len(planes) > 1:
        return "planes farther apart, on both sides of the focus, would decide"
    return (
        "one plane does not separate an origin from a defocus: add a pair of another plane, on the "
        "other side of the focus"
    )
