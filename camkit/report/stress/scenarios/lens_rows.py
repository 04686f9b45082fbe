"""The lens, or the light that it refracts, is another than the bundle thinks."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.haze import without_pedestal
from camkit.psf import FrozenPsf
from camkit.report.stress.kernel_change import with_transformed
from camkit.report.stress.lamps import LIGHTS, Spectrum
from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import (
    Scenario,
    has_haze,
    photographs,
    row,
    varies_over_field,
)
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, see
from camkit.report.stress.shot import Shot
from camkit.report.stress.taking import through_haze, through_lens
from camkit.report.stress.verdict import Verdict
from camkit.runtime.job.choices import known_options
from camkit.runtime.twin.haze_spread import HazeLens
from camkit.runtime.twin.light import Lens, lens_of, with_axis_moved, with_kernels, with_places
from camkit.runtime.twin.truth import light_sensor
from camkit.units import MM_PER_M, to_mm

FOCUS_WITHIN_PER_M: Final = 0.01
FAR_M: Final = 1000.0
"""Stands for infinity, which no chart can show."""
HAZE_SIGMA_PX: Final = 15.0
FAR_PERCENT: Final = (30.0, 40.0)
"""To both sides, for optics with a haze: their peaks are smaller than what else is wrong."""
GRID_UM: Final = np.linspace(0.40, 0.70, 301)


def _knows_beside_focus(bundle: Bundle) -> str | None:
    psf = bundle.stress_psf()
    if psf is None:
        return "it holds no stress_psf.safetensors"
    if bundle.manifest.has_haze and bundle.stress_haze() is None:
        return "its stress PSF knows nothing of its haze"
    if psf.symmetry != "radial":
        return "its stress PSF is not that of a lens of revolution"
    if psf.depths_mm.size < 2 or _off_focus_per_m(bundle, psf).min() > FOCUS_WITHIN_PER_M:
        return "its stress PSF does not hold its focus and something beside it"
    return photographs(bundle)


def _inverse_per_m(psf: FrozenPsf) -> NDArray[np.float64]:
    """Return the distances of a PSF as 1 / m, far to near."""
    inverse: NDArray[np.float64] = np.round(MM_PER_M / psf.depths_mm[::-1], 6)
    return inverse


def _off_focus_per_m(bundle: Bundle, psf: FrozenPsf) -> NDArray[np.float64]:
    defocus: NDArray[np.float64] = np.abs(
        _inverse_per_m(psf) - MM_PER_M / bundle.reference_depth_mm
    )
    return defocus


def distances_of(scenario: Scenario, bundle: Bundle) -> Scenario:
    """Return the scenario with the distances of a bundle's stress PSF; nominal is the focus."""
    psf = bundle.stress_psf()
    assert psf is not None
    values = tuple(float(value) for value in _inverse_per_m(psf))
    nominal = values[int(_off_focus_per_m(bundle, psf).argmin())]
    quick = tuple(sorted({values[0], nominal, values[len(values) // 2], values[-1]}))
    return replace(scenario, values=values, nominal=nominal, quick=quick)


def _at_known_field(scene: Scene, bundle: Bundle) -> tuple[Scene, float]:
    """Place a scene where the stress PSF has a field, since far between its few it says nothing.

    Returns:
        The scene and the height of that field in millimetres.
    """
    psf, sensor = bundle.stress_psf(), bundle.manifest.sensor
    assert psf is not None
    free_px = np.hypot(sensor.width_px - scene.size_px[0], sensor.height_px - scene.size_px[1])
    reach_mm = max(to_mm(sensor.pixel_pitch_um) * float(free_px) / 2, 1e-9)
    heights_mm = psf.field_heights_mm[psf.field_heights_mm <= reach_mm]
    height_mm = float(heights_mm[scene.number % heights_mm.size])
    return replace(scene, share=height_mm / reach_mm), height_mm


def _lens_at(bundle: Bundle, inverse_m: float, height_mm: float) -> Lens:
    """Return the lens for one object distance, with the kernels of one field all around it."""
    psf = bundle.stress_psf()
    assert psf is not None
    depth_mm = MM_PER_M / inverse_m if inverse_m else np.inf
    within_mm = float(np.clip(depth_mm, psf.depths_mm[0], psf.depths_mm[-1]))  # inverse was rounded
    sensor, haze = light_sensor(bundle.manifest), bundle.stress_haze()
    lens = lens_of(psf, sensor, depth_mm=within_mm, haze=haze)

    def at_field(x_mm: float, y_mm: float) -> tuple[float, float]:
        scale = height_mm / max(np.hypot(x_mm, y_mm), 1e-9)
        return scale * x_mm, scale * y_mm

    return replace(with_places(lens, at_field), psf=bundle.psf)


def _off_focus(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    scene_at_field, height_mm = _at_known_field(scene, rig.bundle)
    return rig.shoot(scene_at_field, _lens_at(rig.bundle, value, height_mm))


def _has_depths(bundle: Bundle) -> str | None:
    if not bundle.manifest.has_kernels or bundle.psf.depths_mm.size < 2:
        return "its PSF knows no several depths"
    return photographs(bundle)


def _takes_depth(bundle: Bundle) -> str | None:
    reason = photographs(bundle)
    if reason is not None:
        return reason
    if "depth_m" not in known_options(bundle.manifest.stages):
        return "no stage of it asks for a depth"
    return _has_depths(bundle)


def depths_of(scenario: Scenario, bundle: Bundle) -> Scenario:
    """Return the scenario with the depths of a bundle; nominal is the one nearest to its focus."""
    depths_mm = bundle.psf.depths_mm.tolist()
    values = tuple(sorted({min(depth_mm / MM_PER_M, FAR_M) for depth_mm in depths_mm}))
    focus_m = bundle.reference_depth_mm / MM_PER_M
    nominal = min(values, key=lambda depth_m: abs(1 / depth_m - 1 / focus_m))
    quick = tuple(sorted({values[0], nominal, values[-1]}))
    return replace(scenario, values=values, nominal=nominal, quick=quick)


def _at_depth(judge: Judge, scene: Scene, value: float) -> Shot:
    return judge.rig.shoot(scene, judge.rig.lens_at(value * MM_PER_M))


def _told_depth(judge: Judge, scene: Scene, value: float) -> Verdict:
    """Judge methods that know the depth: what `--depth-m` is worth."""
    rig, shot = judge.rig, _at_depth(judge, scene, value)
    restored = rig.choosing(depth_m=value).restore(shot)
    return Verdict(outcomes=judge.judge(shot, restored, with_chi2=False), seen=see(rig, shot))


def with_split(haze: HazeLens, moved_share: float) -> HazeLens:
    """Return a haze that holds a share of the light of the core kernels as well; the sum stays.

    Args:
        haze: What lies beside the kernels.
        moved_share: Share of the core's light; below 0 the core has it from the haze, as far as
            that holds so much. A place without haze has no shape to lay light in, and gets none.
    """

    def share_at(x_mm: float, y_mm: float) -> FloatArray:
        return haze.share_at(x_mm, y_mm) * np.float32(1 - moved_share)

    def haze_at(x_mm: float, y_mm: float) -> FloatArray:
        kernels = haze.haze_at(x_mm, y_mm)
        light = kernels.sum(axis=(1, 2))
        gained = moved_share * haze.share_at(x_mm, y_mm)
        factor = np.maximum(1 + gained / np.where(light > 0, light, 1), 0)
        return np.asarray(kernels * factor[:, None, None], dtype=np.float32)

    return replace(haze, haze_at=haze_at, share_at=share_at)


def taking_what_there_is(scenario: Scenario, bundle: Bundle) -> Scenario:
    """Return scenario of a bundle: peaks take no more than the place with the least haze has."""
    haze = bundle.haze
    light = haze.kernels.sum(axis=(-2, -1), dtype=np.float64)
    least = -100 * float((light / haze.core_share).min())
    values = tuple(value for value in scenario.values if value >= min(least, 0.0))
    quick = tuple(value for value in scenario.quick if value in values)
    return replace(scenario, values=values, quick=quick)


def add_haze(kernels: FloatArray, share: float) -> FloatArray:
    """Return (c, h, w) kernels that lose a share of their light to a Gaussian haze."""
    down, across = (
        np.exp(-0.5 * (np.arange(-(side // 2), side // 2 + 1) / HAZE_SIGMA_PX) ** 2)
        for side in kernels.shape[-2:]
    )
    haze = np.outer(down, across) / (down.sum() * across.sum())
    return np.asarray((1 - share) * kernels + share * haze, dtype=np.float32)


def _sees_wavelengths(bundle: Bundle) -> str | None:
    if bundle.manifest.has_kernels and bundle.psf.wavelengths_um.size < 2:
        return "its PSF knows one wavelength"
    return photographs(bundle)


def lens_under(rig: Rig, spectrum: Spectrum) -> Lens:
    """Return the lens and white balance under a light, the frozen response being that at 1."""
    wavelengths_um, response = rig.sensor.response_arrays()
    fine = np.stack([np.interp(GRID_UM, wavelengths_um, r, 0, 0) for r in response])
    lit = fine * spectrum(GRID_UM)
    gains = fine.sum(axis=1) / lit.sum(axis=1)
    middle = gains[gains.size // 2]
    lens = rig.lens_under((GRID_UM, lit))
    return replace(lens, gains=tuple(float(gain / middle) for gain in gains))


def _lit_by(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    lens = lens_under(rig, list(LIGHTS.values())[round(value)])
    usual = rig.light(scene).gains
    gains = tuple(a * b for a, b in zip(usual, lens.gains or usual, strict=True))
    return rig.shoot(scene, replace(lens, gains=gains))


def black_taken_off(haze: HazeLens, share: float) -> HazeLens:
    """Return the haze that optics really have where a bundle's stands on a pedestal.

    Args:
        haze: As the bundle has it.
        share: Of a point's light that is black, see `without_pedestal`.
    """

    def haze_at(x_mm: float, y_mm: float) -> FloatArray:
        return without_pedestal(haze.haze_at(x_mm, y_mm), haze.share_at(x_mm, y_mm), share)

    return replace(haze, haze_at=haze_at)


def reaching_far(scenario: Scenario, bundle: Bundle) -> Scenario:
    """Return the scenario of a bundle, with larger changes where it has a haze."""
    if not bundle.manifest.has_haze:
        return scenario
    smaller = tuple(-value for value in reversed(FAR_PERCENT))
    return replace(scenario, values=(*smaller, *scenario.values, *FAR_PERCENT))


def other_lens(lens: Lens, share: float) -> Lens:
    """Return a lens that does in the middle what this one does in the corner, by a share."""
    corner_mm = float(lens.psf.field_heights_mm.max())

    def kernels_at(x_mm: float, y_mm: float) -> FloatArray:
        height_mm = float(np.hypot(x_mm, y_mm))
        other_mm = max(corner_mm - height_mm, 0.0)
        direction = (x_mm / height_mm, y_mm / height_mm) if height_mm else (0.0, 1.0)
        other = lens.kernels_at(-direction[0] * other_mm, -direction[1] * other_mm)
        return np.asarray((1 - share) * lens.kernels_at(x_mm, y_mm) + share * other, np.float32)

    return Lens(psf=lens.psf, kernels_at=kernels_at, margin_px=lens.margin_px, haze=lens.haze)


_DEPTH: Final = row(
    *("depth", "Depth of the scene", "depth_m", "m"),
    "(0.5) 0.7 [1] (1.5)",
    shoot=_at_depth,
    applies=_has_depths,
    fit=depths_of,
    log=True,
    note="The whole scene lies at one depth, which the methods are not told. The depths are those "
    "of the bundle; 1000 m stands for infinity.",
)

SCENARIOS: Final = (
    row(
        *("decentre", "Decentred lens", "decentre_mm", "mm"),
        "[0] 0.1 0.25 0.5 (1) 2 4",
        shoot=through_lens(lambda lens, mm: with_axis_moved(lens, 0.6 * mm, 0.8 * mm)),
        applies=varies_over_field,
        note="The PSFs move, distortion and illumination stay.",
    ),
    row(
        *("defocus", "Object distance", "inverse_distance", "1/m"),
        "[0] 0.02 0.05 0.1 (0.2)",
        shoot=_off_focus,
        applies=_knows_beside_focus,
        fit=distances_of,
        note="0 is infinity, 0.2 is 5 m; at the fields of the bundle's stress PSF, which has few. "
        "The methods are not told the distance.",
    ),
    _DEPTH,
    row(
        *("energy_split", "Light between peak and haze", "moved_percent", "%"),
        "-60 -40 -20 (-10) -5 -2 [0] 2 5 (10) 20 40 60 80",
        shoot=through_haze(with_split),
        applies=has_haze,
        fit=taking_what_there_is,
        note="So much of the peaks' light lies in the haze: walls of grooves that lean, dust. "
        "Below 0 the peaks hold more than the bundle says. Kernels keep their shapes.",
    ),
    row(
        *("haze", "Light lost to haze", "haze_percent", "%"),
        "[0] 1 3 6 (10) 20 40",
        shoot=through_lens(
            lambda lens, percent: with_kernels(lens, lambda k: add_haze(k, percent / 100))
        ),
        note="The haze is a Gaussian of 15 px: dust, a finger print, an aged coating.",
    ),
    row(
        *("illuminant", "Spectrum of the light", "illuminant", ""),
        "[0] 1 2 3 4 5 (6) 7",
        shoot=_lit_by,
        applies=_sees_wavelengths,
        labels=tuple(LIGHTS),
        note="Kernels and white balance change, the colours of the scene stay: colour errors of "
        "the matrix are another matter. The lights have no order; a break point names the first.",
    ),
    replace(
        _DEPTH,
        name="known_depth",
        title="Depth of the scene, known",
        shoot=None,
        measure=_told_depth,
        applies=_takes_depth,
        note="The whole scene lies at one depth, and the methods have the kernels of it. chi^2 is "
        "not judged: it would be calibrated at every depth anew. 1000 m stands for infinity.",
    ),
    row(
        *("lost_dark_frame", "Haze measured without its dark frame", "pedestal_percent", "%"),
        "[0] 1 3 6 (12) 30 60",
        shoot=through_haze(black_taken_off),
        applies=has_haze,
        note="So much of a point's light in the bundle is black level, even over the cells of its "
        "haze; the optics do not have it. 0.1 DN are 12 to 60 % of a point below white.",
    ),
    row(
        *("psf_rotation", "Rotation of the PSF", "rotation_deg", "deg"),
        "[0] 1 2 5 (10) 20 45",
        shoot=through_lens(lambda lens, deg: with_transformed(lens, 1.0, float(np.deg2rad(deg)))),
    ),
    row(
        *("psf_scale", "Size of the PSF", "psf_scale_percent", "%"),
        "-20 -10 (-5) -2 [0] 2 (5) 10 20",
        shoot=through_lens(lambda lens, percent: with_transformed(lens, 1 + percent / 100, 0.0)),
        fit=reaching_far,
        note="The lens's kernels against the bundle's, its haze too where it has one.",
    ),
    row(
        *("wrong_bundle", "Wrong bundle", "other_percent", "%"),
        "[0] 10 25 50 75 (100)",
        shoot=through_lens(lambda lens, percent: other_lens(lens, percent / 100)),
        applies=varies_over_field,
        note="The other lens does in the middle what this one does in the corner, turned by 180 "
        "degrees; below 100 % light goes both ways.",
    ),
)
