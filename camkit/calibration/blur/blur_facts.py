"""The blur of a lens as photographs show it: kernels, their uncertainty, what is not determined."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.blur.blob_basis import PIXEL_VARIANCE, Blobs, FloatGrid, FloatLine
from camkit.calibration.blur.held_out_edges import HeldOut
from camkit.calibration.blur.photo_blur import BlurModel
from camkit.calibration.blur.photo_edges import PhotoEdge
from camkit.calibration.blur.sharp_edges import DIRECTIONS, direction_of
from camkit.calibration.measured import WAVELENGTHS_UM
from camkit.psf import FrozenPsf, PsfUncertainty
from camkit.radial import RadialDistortion
from camkit.units import MM_PER_M

COLOURS: Final = ("red", "green", "blue")
GREY: Final = ("grey",)
FREQUENCIES: Final = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
"""Cycles per pixel at which the transfer is stated."""
LEAST_OF_DIRECTION: Final = 3
LOST_SHARE: Final = 2e-4
"""Of the light of each kernel, that its side may cut off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeightFacts:
    """The blur at one height of the field.

    Attributes:
        height_mm: Distance from the axis.
        edges: Sharp ones that count here, by direction, see `DIRECTIONS`.
        spread_px: (c) of (radial, tangential) standard deviations of the light.
        spread_error_px: Their standard errors.
        offset_px: (c) outward from the middle colour.
        transfer: (c) of (radial, tangential) at `FREQUENCIES`.
        transfer_error: Their standard errors.
    """

    height_mm: float
    edges: tuple[int, ...]
    spread_px: FloatGrid
    spread_error_px: FloatGrid
    offset_px: FloatLine
    transfer: FloatGrid
    transfer_error: FloatGrid

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        names = COLOURS if len(self.spread_px) == len(COLOURS) else GREY
        return {
            "height_mm": round(self.height_mm, 4),
            "edges": dict(zip(DIRECTIONS, self.edges, strict=True)),
            "colours": [
                {
                    "colour": name,
                    "spread_px": np.round(self.spread_px[c], 3).tolist(),
                    "spread_error_px": np.round(self.spread_error_px[c], 3).tolist(),
                    "outward_px": round(float(self.offset_px[c]), 3),
                    "transfer": np.round(self.transfer[c], 3).tolist(),
                    "transfer_error": np.round(self.transfer_error[c], 3).tolist(),
                }
                for c, name in enumerate(names)
            ],
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhotoBlur:
    """The result of `camkit calibrate blur`.

    Attributes:
        psf: Kernels over the field.
        uncertainty: How far they may be off.
        heights: The facts at each height.
        held_out: What edges say that kernels were not fitted to.
        photos: Name -> edges found, places that were looked at, clipped ones.
        reach_px: To both sides of an edge.
        edges: Found in all photographs.
        sharp: Of these, which count.
        smoothness: Of each colour, the penalty that was chosen.
        notes: What is not determined, and what else a person should know.
    """

    psf: FrozenPsf
    uncertainty: PsfUncertainty
    heights: tuple[HeightFacts, ...]
    held_out: HeldOut
    photos: dict[str, tuple[int, int, int]]
    reach_px: float
    edges: int
    sharp: int
    smoothness: tuple[float, ...]
    notes: tuple[str, ...]

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "photos": {
                name: dict(zip(("edges", "looked_at", "clipped"), counts, strict=True))
                for name, counts in self.photos.items()
            },
            "edges": self.edges,
            "sharp": self.sharp,
            "reach_px": self.reach_px,
            "pixel_pitch_um": self.psf.pixel_pitch_um,
            "side_px": int(self.psf.kernels.shape[-1]),
            "frequencies": list(FREQUENCIES),
            "heights": [one.to_json() for one in self.heights],
            "held_out": self.held_out.to_json(),
            "uncertainty": {
                "noise": float(f"{self.uncertainty.noise:.3g}"),
                "shift_px": float(f"{self.uncertainty.shift_px:.3g}"),
                "width": float(f"{self.uncertainty.width:.3g}"),
            },
            "smoothness": list(self.smoothness),
            "notes": list(self.notes),
        }


def frozen_blur(model: BlurModel, pitch_um: float, depth_m: float) -> FrozenPsf:
    """Return the kernels of a model as a PSF: blue, green, red at each height."""
    heights, weights = model.heights_mm, model.weights
    if heights[0] > 0:  # a PSF begins on the axis, where kernels are round
        heights = np.concatenate([[0.0], heights])
        weights = np.concatenate([round_weights(model.blobs, weights[:, :1]), weights], axis=1)
    half = int(np.ceil(np.hypot(model.blobs.u_px, model.blobs.v_px).max())) + 2
    kernels = model.blobs.kernels(weights, half)
    kernels = cut_kernels(kernels)
    kernels = np.swapaxes(kernels[::-1], 0, 1)[:, None]
    colours = kernels.shape[2]
    middle = WAVELENGTHS_UM[1:2]
    return FrozenPsf(
        kernels=np.ascontiguousarray(kernels, dtype=np.float32),
        field_heights_mm=heights,
        depths_mm=np.array([depth_m * MM_PER_M]),
        wavelengths_um=np.array(WAVELENGTHS_UM if colours > 1 else middle),
        pixel_pitch_um=pitch_um,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0, 0, 0]]), radius_mm=1.0),
        relative_illumination=np.ones(heights.size),
        symmetry="radial" if heights.size > 1 else "uniform",
    )


def round_weights(blobs: Blobs, weights: FloatGrid) -> FloatGrid:
    """Return weights (..., k) of round kernels with as much light at each radius."""
    rings = blobs.rings()
    rounded = weights @ (rings > 0) / np.maximum((rings > 0).sum(axis=0), 1) @ rings.T
    return np.asarray(rounded / rounded.sum(axis=-1, keepdims=True))


def cut_kernels(kernels: FloatGrid) -> FloatGrid:
    """Return kernels as large as their light, of unit sum."""
    half = kernels.shape[-1] // 2
    for smaller in range(2, half):
        inner = kernels[
            ..., half - smaller : half + smaller + 1, half - smaller : half + smaller + 1
        ]
        if (1 - inner.sum(axis=(-2, -1))).max() < LOST_SHARE:
            return np.asarray(inner / inner.sum(axis=(-2, -1), keepdims=True))
    return kernels


def height_facts(model: BlurModel, edges: Sequence[PhotoEdge]) -> tuple[HeightFacts, ...]:
    """Return the facts at each height of a model."""
    counts = direction_counts(model, edges)
    spread, transfer = _spreads(model.blobs, model.weights), _transfer(model.blobs, model.weights)
    spread_error = jackknife_error(_spreads(model.blobs, model.varied))
    transfer_error = jackknife_error(_transfer(model.blobs, model.varied))
    outward = model.weights @ model.blobs.u_px
    outward -= outward[len(outward) // 2]
    return tuple(
        HeightFacts(
            height_mm=float(height),
            edges=tuple(counts[n].tolist()),
            spread_px=spread[:, n],
            spread_error_px=spread_error[:, n],
            offset_px=outward[:, n],
            transfer=transfer[:, n],
            transfer_error=transfer_error[:, n],
        )
        for n, height in enumerate(model.heights_mm)
    )


def direction_counts(model: BlurModel, edges: Sequence[PhotoEdge]) -> NDArray[np.intp]:
    """Return (node, direction): sharp edges nearest to each height."""
    counts = np.zeros((model.heights_mm.size, len(DIRECTIONS)), dtype=np.intp)
    for i in np.flatnonzero(model.sharp_half.any(axis=1)).tolist():
        counts[model.shares[i].argmax(), direction_of(edges[i])] += 1
    return counts


def jackknife_error(varied: FloatGrid) -> FloatGrid:
    """Return the standard error of what came out each time without a group.

    Args:
        varied: (group, ...).
    """
    groups = len(varied)
    return np.asarray(np.sqrt((groups - 1) * varied.var(axis=0)))


def _spreads(blobs: Blobs, weights: FloatGrid) -> FloatGrid:
    """Return (..., 2): radial and tangential standard deviations of the light."""
    widths = blobs.spread_px**2 - PIXEL_VARIANCE
    outward = weights @ blobs.u_px
    radial = weights @ (blobs.u_px**2 + widths) - outward**2
    tangential = weights @ (blobs.v_px**2 + widths)
    return np.sqrt(np.stack([radial, tangential], axis=-1))


def _transfer(blobs: Blobs, weights: FloatGrid) -> FloatGrid:
    """Return (..., 2, frequency): transfer along and across the radius."""
    at = np.array(FREQUENCIES)
    widths = np.exp(-2 * np.pi**2 * at**2 * (blobs.spread_px**2 - PIXEL_VARIANCE)[:, None])
    radial = np.abs(weights @ (widths * np.exp(-2j * np.pi * at * blobs.u_px[:, None])))
    tangential = np.abs(weights @ (widths * np.cos(2 * np.pi * at * blobs.v_px[:, None])))
    return np.stack([radial, tangential], axis=-2)


def blur_uncertainty(model: BlurModel) -> PsfUncertainty:
    """Return how far kernels move when edges are left out, at least what measured kernels have."""
    least = PsfUncertainty()
    half = int(np.ceil(np.hypot(model.blobs.u_px, model.blobs.v_px).max())) + 2
    kernels = model.blobs.kernels(model.weights, half)
    varied = model.blobs.kernels(model.varied, half)
    peaks = kernels.max(axis=(-2, -1))
    error = jackknife_error(varied).max(axis=(-2, -1))
    noise = float(np.median(error / peaks))
    places = model.varied @ model.blobs.u_px
    places -= places.mean(axis=1, keepdims=True)
    shift = float(np.median(jackknife_error(places)))
    sizes = np.log(_spreads(model.blobs, model.varied)).mean(axis=(1, 2, 3))
    width = float(jackknife_error(sizes[:, None])[0])
    return PsfUncertainty(
        noise=float(np.clip(noise, least.noise, 0.5)),
        shift_px=float(np.clip(shift, least.shift_px, 0.99)),
        width=float(np.clip(width, least.width, 0.5)),
    )


def coverage_notes(
    model: BlurModel, edges: Sequence[PhotoEdge], radius_mm: float, bare_heights: FloatLine
) -> list[str]:
    """Return what the edges do not determine.

    Args:
        model: The kernels.
        edges: All edges.
        radius_mm: From the axis to the farthest corner.
        bare_heights: Heights that have too few edges.
    """
    notes = []
    heights = np.array([edge.height_mm for edge in edges])
    for height in bare_heights:
        count = int((np.abs(heights - height) < radius_mm / 6).sum())
        lower, higher = (
            model.heights_mm[model.heights_mm < height][-1:],
            model.heights_mm[model.heights_mm > height][:1],
        )
        sources = " and ".join(f"{at / radius_mm:.0%}" for at in (*lower, *higher))
        notes.append(
            f"{height / radius_mm:.0%} of the way to the corner: {count} edges, not determined; "
            f"kernels there are those of {sources}"
        )
    for height, counts in zip(model.heights_mm, direction_counts(model, edges), strict=True):
        few = [
            f"{name} ({count} edges)"
            for name, count in zip(DIRECTIONS, counts.tolist(), strict=True)
            if count < LEAST_OF_DIRECTION and name != "oblique"
        ]
        if few:
            notes.append(
                f"{height / radius_mm:.0%} of the way to the corner: {' and '.join(few)} blur is "
                "hardly seen there; neighbouring heights and smoothness decide"
            )
    return notes
