"""Facts of a PSF for people: its places, their span, its colours, the widths of its kernels."""

from typing import Any, Final

import numpy as np

from camkit.bundle.states.lens_state import LensState
from camkit.calibration.psf_import.kernel_stack import FloatGrid
from camkit.psf import FrozenPsf, PsfUncertainty, depth_name
from camkit.units import UM_PER_MM

LEAST_SPAN_MM: Final = 1.0
MOST_SPAN_MM: Final = 150.0
"""Longest side of the sensors that cameras have, from endoscopes to large format."""
MEASURED: Final = "kernels measured or computed elsewhere (camkit psf import, calibrate blur)"
STATES_SOURCE: Final = "camkit freeze"
"""Of several configurations, which nothing else writes."""
UNKNOWN_SOURCE: Final = "frozen optics (camkit freeze), or a measurement that states no uncertainty"


def span_mm(psf: FrozenPsf) -> tuple[float, float] | None:
    """Return width and height from the first place to the last; None for one place.

    Kernels of a lens of revolution reach as far to all sides.
    """
    if psf.field_heights_mm.size < 2:
        return None
    if psf.grid_x_mm is None or psf.grid_y_mm is None:
        diameter_mm = 2 * float(psf.field_heights_mm[-1])
        return diameter_mm, diameter_mm
    return float(np.ptp(psf.grid_x_mm)), float(np.ptp(psf.grid_y_mm))


def span_note(psf: FrozenPsf) -> str | None:
    """Return a note on places whose span no sensor has; None for a usual one."""
    span = span_mm(psf)
    if span is None or LEAST_SPAN_MM <= max(span) <= MOST_SPAN_MM:
        return None
    pixels = " x ".join(f"{side * UM_PER_MM / psf.pixel_pitch_um:.0f}" for side in span)
    rare = "large" if max(span) > MOST_SPAN_MM else "small"
    return (
        f"kernels lie over {span[0]:.4g} x {span[1]:.4g} mm, {pixels} px: hardly a sensor is so "
        f"{rare}; are their places in mm, and not in um or cm?"
    )


def places_text(psf: FrozenPsf) -> str:
    """Return the places, colours and samples as part of a line."""
    places, colours = psf.field_heights_mm.size, psf.wavelengths_um.size
    span = span_mm(psf)
    span_text = "" if span is None else f", over {span[0]:.4g} x {span[1]:.4g} mm"
    return (
        f"{places} place{'s' * (places != 1)} ({psf.symmetry}), {colours} "
        f"colour{'s' * (colours != 1)}, {psf.kernels.shape[-1]} px at {psf.pixel_pitch_um:g} um"
        f"{span_text}"
    )


def sigmas_px(psf: FrozenPsf) -> FloatGrid:
    """Return the widths (field, depth, wavelength) of kernels about their centroids.

    Root of the mean variance of both axes: that of a Gaussian is its sigma.
    """
    kernels = psf.kernels.astype(np.float64)
    variance = np.zeros(kernels.shape[:3])
    for axis in (-2, -1):
        profile = kernels.sum(axis)
        places = np.arange(profile.shape[-1])
        variance += profile @ places**2 - (profile @ places) ** 2
    return np.sqrt(np.maximum(variance / 2, 0.0))


def state_facts(state: LensState) -> dict[str, Any]:
    """Return what a file of several states holds of one, plain JSON values."""
    focus_mm = state.object_distance_mm
    return {
        "efl_mm": round(state.efl_mm, 4),
        "f_number": round(state.f_number, 4),
        "object_distance_mm": focus_mm if np.isfinite(focus_mm) else None,
        **psf_facts(state.psf, None, STATES_SOURCE),
    }


def half_light_px(psf: FrozenPsf) -> FloatGrid:
    """Return the radius (field, depth, wavelength) about the centroid with half of the light.

    Far rings of diffraction, which the window cuts off, widen it little; a sigma counts them by
    their squared distance.
    """
    kernels = psf.kernels.reshape(-1, *psf.kernels.shape[-2:]).astype(np.float64)
    y, x = np.indices(kernels.shape[1:])
    radii = []
    for kernel in kernels / kernels.sum((1, 2), keepdims=True):
        distance = np.hypot(y - (kernel * y).sum(), x - (kernel * x).sum()).ravel()
        light = kernel.ravel()[np.argsort(distance)].cumsum()
        # pixels nearer than r fill the area of a circle
        area_px = np.interp(0.5, [0.0, *light], np.arange(light.size + 1))
        radii.append(np.sqrt(area_px / np.pi))
    return np.array(radii).reshape(psf.kernels.shape[:3])


def psf_facts(
    psf: FrozenPsf, uncertainty: PsfUncertainty | None, source: str | None = None
) -> dict[str, Any]:
    """Return what a file of a PSF holds, plain JSON values; its source as far as it is stated."""
    sigmas, halves, span = sigmas_px(psf), half_light_px(psf), span_mm(psf)
    return {
        "source": source or (UNKNOWN_SOURCE if uncertainty is None else MEASURED),
        "places": int(psf.field_heights_mm.size),
        "symmetry": psf.symmetry,
        "span_mm": None if span is None else [round(side, 4) for side in span],
        "colours": int(psf.wavelengths_um.size),
        "wavelengths_um": [round(float(wave), 4) for wave in psf.wavelengths_um],
        "side_px": int(psf.kernels.shape[-1]),
        "pixel_pitch_um": psf.pixel_pitch_um,
        "half_light_px": [round(float(value), 3) for value in (halves.min(), halves.max())],
        "sigma_px": [round(float(value), 3) for value in (sigmas.min(), sigmas.max())],
        "depths": [depth_name(value) for value in psf.depths_mm],
        "focus_um": None if psf.focus_um is None else psf.focus_um.tolist(),
        "uncertainty": None
        if uncertainty is None
        else {
            "noise": uncertainty.noise,
            "shift_px": uncertainty.shift_px,
            "width": uncertainty.width,
        },
    }
