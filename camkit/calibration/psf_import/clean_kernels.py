"""A stack of kernels to a frozen PSF: background, negative values, middle, pitch, side, sum."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.psf_import.kernel_places import Places, places_of
from camkit.calibration.psf_import.kernel_resampling import (
    SAME_PITCH,
    resampled_kernels,
    window,
)
from camkit.calibration.psf_import.kernel_stack import (
    GREY,
    WAVELENGTH_OF,
    FloatGrid,
    ImportOptions,
    KernelStack,
    refuse,
)
from camkit.calibration.psf_import.kernel_uncertainty import estimate_uncertainty
from camkit.calibration.psf_import.psf_facts import span_note
from camkit.calibration.psf_import.psf_source import read_source
from camkit.caller import option_text
from camkit.psf import FrozenPsf, PsfUncertainty
from camkit.radial import RadialDistortion
from camkit.units import MM_PER_M

LEAST_BORDER: Final = 0.01
"""Share of the light that the level of the border would hold, from which on a note names it."""
LEAST_NEGATIVE: Final = 1e-3
LEAST_CUT: Final = 1e-3
MOST_PLACES: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Normalised:
    """Changes that were made to the kernels, and their oddities; shares are of the light.

    Attributes:
        sums: Least and largest sum before.
        negative_share: Largest share of negative values, which were cut.
        border_share: Largest share that the level of the border would hold all over a kernel.
        border_noise: Scatter along the border, of the peak.
        background: Whether that level was taken off.
        middle_px: (row, column) of the sample that was taken for the middle, of the first kernel.
        centroid_px: Largest distance of a kernel's centre of light from it, in samples as read.
        ratio: Pitch as read over that of the result.
        cut_share: Largest share of light beyond the side.
    """

    sums: tuple[float, float]
    negative_share: float
    border_share: float
    border_noise: float
    background: bool
    middle_px: tuple[int, int]
    centroid_px: float
    ratio: float
    cut_share: float

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "sums": [float(f"{value:.6g}") for value in self.sums],
            "negative_share": float(f"{self.negative_share:.3g}"),
            "border_share": float(f"{self.border_share:.3g}"),
            "border_noise": float(f"{self.border_noise:.3g}"),
            "background_subtracted": self.background,
            "middle_px": list(self.middle_px),
            "centroid_px": round(self.centroid_px, 3),
            "resampled_by": round(self.ratio, 6),
            "cut_share": float(f"{self.cut_share:.3g}"),
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportedPsf:
    """The result of an import.

    Attributes:
        psf: Of one depth.
        uncertainty: How far it may be off.
        is_estimated: Whether that was estimated.
        normalised: What was changed.
        shape: (row, column, colour, h, w) as read.
        files: How many were read.
        notes: What a person should know.
    """

    psf: FrozenPsf
    uncertainty: PsfUncertainty
    is_estimated: bool
    normalised: Normalised
    shape: tuple[int, ...]
    files: int
    notes: tuple[str, ...]

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        psf = self.psf
        grids = {"grid_x_mm": psf.grid_x_mm, "grid_y_mm": psf.grid_y_mm}
        return {
            "files": self.files,
            "shape": list(self.shape),
            "symmetry": psf.symmetry,
            "fields": int(psf.field_heights_mm.size),
            **{name: axis.round(6).tolist() for name, axis in grids.items() if axis is not None},
            "heights_mm": psf.field_heights_mm.round(6).tolist(),
            "wavelengths_um": psf.wavelengths_um.tolist(),
            "pixel_pitch_um": psf.pixel_pitch_um,
            "side_px": int(psf.kernels.shape[-1]),
            "normalised": self.normalised.to_record(),
            "uncertainty": {
                "noise": round(self.uncertainty.noise, 5),
                "shift_px": round(self.uncertainty.shift_px, 5),
                "width": round(self.uncertainty.width, 5),
                "estimated": self.is_estimated,
            },
            "notes": list(self.notes),
        }


def imported_psf(source: str | Path, options: ImportOptions) -> ImportedPsf:
    """Read kernels and return them as a frozen PSF.

    Raises:
        ContractError: If options are missing or do not fit; one message names all faults.
        DecodeError: If a file is damaged.
    """
    stack = read_source(source, options)
    places, faults = places_of(stack, options)
    waves, wave_faults = _wavelengths(stack, options)
    pitch_um = stack.pitch_um if options.pitch_um is None else options.pitch_um
    faults += wave_faults
    if pitch_um is None:
        faults.append(f"the files state no spacing of the samples; add {option_text('pitch_um')}")
    faults += _value_faults(stack.values)
    refuse(faults)
    assert places is not None
    assert pitch_um is not None
    order = np.argsort(waves)
    stack = replace(stack, values=stack.values[:, :, order])
    target_um = pitch_um if options.to_pitch_um is None else options.to_pitch_um
    kernels, normalised = _cleaned(stack, places, options, pitch_um / target_um)
    psf = FrozenPsf(
        kernels=np.ascontiguousarray(kernels, dtype=np.float32),
        field_heights_mm=places.heights_mm,
        depths_mm=np.array([options.depth_m * MM_PER_M]),
        wavelengths_um=np.array(sorted(waves)),
        pixel_pitch_um=target_um,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0, 0, 0]]), radius_mm=1.0),
        relative_illumination=np.ones(places.heights_mm.size),
        symmetry=places.symmetry,
        grid_x_mm=places.x_mm,
        grid_y_mm=places.y_mm,
    )
    uncertainty = options.uncertainty
    span_notes = filter(None, [span_note(psf)])
    return ImportedPsf(
        psf=psf,
        uncertainty=uncertainty or estimate_uncertainty(psf, normalised.border_noise),
        is_estimated=uncertainty is None,
        normalised=normalised,
        shape=stack.values.shape,
        files=stack.files,
        notes=(*stack.notes, *_notes(normalised, stack.values.shape, options), *span_notes),
    )


def _wavelengths(stack: KernelStack, options: ImportOptions) -> tuple[tuple[float, ...], list[str]]:
    """Return the wavelength of every entry of axis c, and faults."""
    count = stack.values.shape[2]
    waves = options.wavelengths_um
    letters = options.colours or stack.colours
    if waves is None and options.colours is None and stack.colours is None:
        waves = stack.wavelengths_um
        letters = {1: GREY, 3: "RGB"}.get(count)
    if waves is None and letters is not None:
        waves = tuple(WAVELENGTH_OF[letter] for letter in letters.upper())
    if waves is None:
        return (), [
            f"axis c has {count} entries; name them by {option_text('colours')} (RGB) or "
            f"{option_text('wavelengths_um')}, or the axes in their order by {option_text('axes')}"
        ]
    option_name = option_text("colours" if options.wavelengths_um is None else "wavelengths_um")
    if len(waves) != count:
        return (), [f"{option_name} names {len(waves)} colours, the files have {count}"]
    if len(set(waves)) != count or min(waves) <= 0:
        return (), [f"the wavelengths {list(waves)} of axis c must differ and be > 0"]
    return tuple(map(float, waves)), []


def _value_faults(values: FloatGrid) -> list[str]:
    """Return what is wrong with the values of kernels, with their places."""
    bad = np.logical_not(np.isfinite(values).all(axis=(-2, -1)))
    dark = ~bad & ~(np.where(bad[..., None, None], 1, values).sum((-2, -1)) > 0)
    texts = {"NaN or infinite values": bad, "no light": dark}
    return [f"{what} in {_where(mask)}" for what, mask in texts.items() if mask.any()]


def _where(mask: NDArray[np.bool_]) -> str:
    places = [f"row {r} column {c} colour {k}" for r, c, k in np.argwhere(mask).tolist()]
    more = len(places) - MOST_PLACES
    return ", ".join(places[:MOST_PLACES]) + (f" and {more} more" if more > 0 else "")


def _cleaned(
    stack: KernelStack, places: Places, options: ImportOptions, ratio: float
) -> tuple[FloatGrid, Normalised]:
    """Return (field, 1, colour, side, side) kernels of unit sum, and what was changed."""
    values = stack.values
    border = np.concatenate(
        [values[..., 0, :], values[..., -1, :], values[..., 1:-1, 0], values[..., 1:-1, -1]],
        axis=-1,
    )
    level = np.median(border, axis=-1)
    sums = values.sum((-2, -1))
    border_share = float((level * values[0, 0, 0].size / sums).max())
    noise = float(np.median(border.std(axis=-1) / values.max(axis=(-2, -1))))
    if options.background == "border":
        values = values - level[..., None, None]
    negative = -np.clip(values, None, 0).sum((-2, -1))
    values = np.clip(values, 0, None)
    dark = values.sum((-2, -1)) <= 0
    refuse([f"no light above the border in {_where(dark)}"] if dark.any() else [])
    negative_share = max(0.0, float((negative / values.sum((-2, -1))).max()))
    middles = _middles(values, stack.middle_px, options.centre)
    values, middles = _flipped(
        values, middles, options.flip, turns_places=places.symmetry == "grid"
    )
    centroid_px = float(np.abs(_centroids(values) - middles).max())
    kernels = resampled_kernels(_centred(values, middles), ratio)
    light = kernels.sum((-2, -1))
    if options.side_px is not None:
        kernels = window(kernels, options.side_px)
    cut_share = float((1 - kernels.sum((-2, -1)) / light).max())
    kernels = kernels / kernels.sum((-2, -1), keepdims=True)
    row, column = middles[0, 0].tolist()
    normalised = Normalised(
        sums=(float(sums.min()), float(sums.max())),
        negative_share=negative_share,
        border_share=border_share,
        border_noise=noise,
        background=options.background == "border",
        middle_px=(int(row), int(column)),
        centroid_px=centroid_px,
        ratio=ratio,
        cut_share=max(cut_share, 0.0),
    )
    return kernels.reshape(-1, 1, *kernels.shape[2:]), normalised


def _centroids(values: FloatGrid) -> FloatGrid:
    """Return (row, column, 2) centres of light of all colours together."""
    light = values.sum(axis=2)
    total = light.sum((-2, -1))
    rows, columns = (np.arange(side) for side in light.shape[-2:])
    return np.stack([light.sum(-1) @ rows / total, light.sum(-2) @ columns / total], axis=-1)


def _middles(values: FloatGrid, stated_px: tuple[int, int] | None, centre: str) -> NDArray[np.int_]:
    """Return (row, column, 2) samples that are the middles of kernels."""
    h, w = values.shape[-2:]
    if centre == "centroid":
        return np.rint(_centroids(values)).astype(int)
    if centre == "peak":
        light = values.sum(axis=2).reshape(*values.shape[:2], -1)
        return np.stack(np.unravel_index(light.argmax(axis=-1), (h, w)), axis=-1)
    return np.broadcast_to(np.array(stated_px or (h // 2, w // 2)), (*values.shape[:2], 2))


def _flipped(
    values: FloatGrid, middles: NDArray[np.int_], flip: str, *, turns_places: bool
) -> tuple[FloatGrid, NDArray[np.int_]]:
    """Mirror kernels, and the rows or columns that they lie in, of axes that run the other way."""
    middles = middles.copy()
    if flip == "kernels":
        flip, turns_places = "xy", False
    for name, axis in (("y", 0), ("x", 1)):
        if name not in flip:
            continue
        values = np.flip(values, axis - 2)
        middles[..., axis] = values.shape[axis - 2] - 1 - middles[..., axis]
        if turns_places:
            values, middles = np.flip(values, axis), np.flip(middles, axis)
    return values, middles


def _centred(values: FloatGrid, middles: NDArray[np.int_]) -> FloatGrid:
    """Fill kernels up to odd squares whose middles are the middles of all."""
    h, w = values.shape[-2:]
    to_end = np.array([h - 1, w - 1]) - middles
    half = int(max(middles.max(), to_end.max()))
    side = 2 * half + 1
    squares = np.zeros((*values.shape[:-2], side, side))
    for row, column in np.ndindex(*middles.shape[:2]):
        top, left = half - middles[row, column]
        squares[row, column, :, top : top + h, left : left + w] = values[row, column]
    return squares


def _notes(normalised: Normalised, shape: Sequence[int], options: ImportOptions) -> list[str]:
    """Return what a person should look at."""
    notes = []
    h, w = shape[-2:]
    if (h % 2 == 0 or w % 2 == 0) and options.centre == "middle":
        row, column = normalised.middle_px
        notes.append(
            f"{h} x {w} samples have no middle one: that of row {row}, column {column} (from 0) is "
            f"taken; {option_text('centre', 'peak')} takes the brightest"
        )
    if normalised.border_share > LEAST_BORDER and not normalised.background:
        notes.append(
            f"the level along the border, all over the kernel, is {normalised.border_share:.1%} of "
            f"the light: {option_text('background', 'border')} takes it off if it is background; "
            "if it is blur that reaches past the border, give larger kernels"
        )
    if normalised.negative_share > LEAST_NEGATIVE:
        share = f"{normalised.negative_share:.2%} of the light"
        notes.append(
            f"noise below the subtracted level, {share}, was cut, and about as much above it "
            f"stays: {option_text('side_px')} leaves it out"
            if normalised.background
            else f"negative values, {share}, were cut"
        )
    if normalised.centroid_px > max(1.0, min(h, w) / 8):
        notes.append(
            f"the light of a kernel lies {normalised.centroid_px:.1f} samples off the middle: it "
            f"moves the picture; {option_text('centre', 'centroid')} centres it"
        )
    if abs(normalised.ratio - 1) > SAME_PITCH:
        notes.append(f"resampled to {1 / normalised.ratio:.4g} times the spacing, by area")
    if normalised.cut_share > LEAST_CUT:
        notes.append(f"{normalised.cut_share:.2%} of the light lies beyond the side and was cut")
    return notes
