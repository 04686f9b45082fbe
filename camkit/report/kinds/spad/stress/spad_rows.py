"""The scenarios of single photons: light and pixels, plate and array, times of photons."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Sharpen, SuperResolve
from camkit.calibration.dots import ACTIVE_UM
from camkit.errors import UnsupportedError
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.kernels import blurred, etched, opened, shift_kernel, turned
from camkit.report.kinds.spad.stress.spad_scene import SpadScene
from camkit.report.kinds.spad.stress.spad_score import OF_DEPTH, OF_PICTURES
from camkit.report.kinds.spad.stress.spad_shot import (
    PHOTONS,
    DepthSetting,
    DepthShot,
    PictureSetting,
    PictureShot,
)
from camkit.report.stress.scenario import Shoot, row
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.sampling import point_kernel
from camkit.runtime.kinds.spad.pulse import GatedPulse, Pulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.units import UM_PER_MM

SPREAD: Final = 1.0
"""Of the logarithm of dark counts."""
HOT_SHARE: Final = 0.01
HOT_COUNTS: Final = 5 * PHOTONS
HOT_COUNTS_OF_A_BIN: Final = 50.0
FEW_PHOTONS: Final = 1000.0
TWO_PHOTONS: Final = 4000.0
APERTURE_MM: Final = 14.0
"""Of the plate and of its stop: 16 units of 0.873 mm."""
FOCAL_MM: Final = 50.0
LEVELS: Final = 8


def makes_finer(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of pictures; None if it can."""
    return None if bundle.manifest.stage(SuperResolve) else "it makes no picture of photons finer"


def has_times(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of depth; None if it can."""
    return makes_finer(bundle) if bundle.manifest.stage(Sharpen) else "it knows no times of photons"


def _counting(
    setting: Callable[[SpadJudge, SpadScene, float], PictureSetting], *, with_chi2: bool = True
) -> Shoot:
    """Return what counts a picture."""

    def shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
        return judge.shoot(scene, setting(judge, scene, value), with_chi2=with_chi2)

    return shoot


def _through_kernel(
    change: Callable[[FloatArray, FineCamera, float], FloatArray], *, bare_too: bool = False
) -> Shoot:
    """Return what counts a picture behind a changed kernel, without the plate as well if asked."""

    def setting(judge: SpadJudge, _scene: SpadScene, value: float) -> PictureSetting:
        camera = judge.studio.camera
        kernel, bare = change(camera.kernel, camera, value), None
        if bare_too:
            bare = change(point_kernel(kernel.shape[0]), camera, value)
        return PictureSetting(kernel=kernel, bare_kernel=bare)

    return _counting(setting)


def _scanning(setting: Callable[[TimeAxis, Pulse, float], DepthSetting]) -> Shoot:
    """Return what counts surfaces by time; settings start from axis and pulse of the bundle."""

    def shoot(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
        return judge.scan(scene, setting(*judge.studio.times(), value))

    return shoot


def dark_map(shape: tuple[int, int], mean: float, seed: int) -> NDArray[np.float64]:
    """Return dark counts (h, w), log-normal from pixel to pixel."""
    chance = np.random.default_rng(seed)
    return mean * chance.lognormal(-(SPREAD**2) / 2, SPREAD, shape)


def hot_mask(shape: tuple[int, int], share: float, seed: int) -> NDArray[np.bool_]:
    """Return pixels (h, w) drawn at random; those of a smaller share are among them."""
    return np.asarray(np.random.default_rng(seed).random(shape) < share)


def _dark(judge: SpadJudge, scene: SpadScene, value: float) -> PictureSetting:
    return PictureSetting(dark=dark_map(judge.studio.shape, value, scene.number))


def _unknown_dark(judge: SpadJudge, scene: SpadScene, value: float) -> PictureSetting:
    return replace(_dark(judge, scene, value), dark_known=False)


def _hot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureSetting:
    hot = hot_mask(judge.studio.shape, value, scene.number)
    return PictureSetting(hot=hot, hot_counts=HOT_COUNTS)


def _unknown_hot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureSetting:
    return replace(_hot(judge, scene, HOT_SHARE), hot_counts=value, hot_known=False)


def _hot_scan(judge: SpadJudge, scene: SpadScene, value: float) -> DepthShot:
    hot = hot_mask(judge.studio.shape, value, scene.number)
    return judge.scan(scene, DepthSetting(hot=hot, hot_counts=HOT_COUNTS_OF_A_BIN))


def _pitch_um(camera: FineCamera) -> float:
    """Return the pitch of the sub-pixels."""
    return camera.sensor.pixel_pitch_um / camera.scale


def _opened(kernel: FloatArray, camera: FineCamera, diameter_um: float) -> FloatArray:
    # an even disc has a sixteenth of its diameter squared as variance along an axis
    return opened(kernel, (diameter_um**2 - ACTIVE_UM**2) / 16 / _pitch_um(camera) ** 2)


def _active_area(judge: SpadJudge, _scene: SpadScene, value: float) -> PictureSetting:
    camera = judge.studio.camera
    kernel = _opened(camera.kernel, camera, value)
    bare = _opened(point_kernel(kernel.shape[0]), camera, value)
    light = PHOTONS * (value / ACTIVE_UM) ** 2
    return PictureSetting(kernel=kernel, bare_kernel=bare, photons=light)


def _defocused(kernel: FloatArray, camera: FineCamera, defocus_mm: float) -> FloatArray:
    """Make every dot a disc, z D / f wide."""
    return blurred(kernel, defocus_mm * UM_PER_MM * APERTURE_MM / FOCAL_MM / _pitch_um(camera))


def _shifted_plate(_judge: SpadJudge, _scene: SpadScene, value: float) -> PictureSetting:
    """Move the plate: in the pupil that moves no light on the sensor, but covers less of it."""
    return PictureSetting(plate_light=(1 - abs(value) / APERTURE_MM) ** 2)


def gate_like(gate: Pulse, *, width: float = 1.0, rc: float = 1.0) -> Pulse:
    """Return a gate whose width and time constant are other ones, by factors.

    Raises:
        UnsupportedError: If it is no gate.
    """
    if not isinstance(gate, GatedPulse):
        raise UnsupportedError("the bundle states no gate, so none can be another")
    return replace(gate, width_ps=width * gate.width_ps, rc_ps=rc * gate.rc_ps)


def _through_gate(axis: TimeAxis, pulse: Pulse, *, width: float = 1, rc: float = 1) -> DepthSetting:
    """Photograph through another gate; the fit believes what the bundle states."""
    return DepthSetting(pulse=gate_like(pulse, width=width, rc=rc), assumed=(axis, pulse))


def _turned_round(axis: TimeAxis, pulse: Pulse, value: float) -> DepthSetting:
    """Read a gate scan as a histogram, or the other way round: the pulse runs the other way."""
    other = replace(axis, orientation="histogram" if axis.orientation == "gate" else "gate")
    return DepthSetting(assumed=(axis if value == 0 else other, pulse))


_light_row = partial(row, applies=makes_finer)
_depth_row = partial(row, applies=has_times)
_PILE_UP: Final = (
    "The chance that the brightest pixel counts a photon, in its brightest bin, of a cycle. "
    f"{OF_DEPTH}"
)

LIGHT: Final = (
    _light_row(
        *("dark_map", "Dark counts, map known", "dark counts of a pixel", ""),
        "[0] 10 100 (1000) 10000 30000 (100000) 1000000",
        shoot=_counting(_dark),
        log=True,
        note=f"10,000 photons of white; a log-normal map of spread 1. {OF_PICTURES}",
    ),
    _light_row(
        *("dark_unknown", "Dark counts, unknown", "dark counts of a pixel", ""),
        "[0] 10 30 (100) 300 (1000) 3000 10000",
        shoot=_counting(_unknown_dark),
        log=True,
        note=f"As with a known map, but nothing is taken off. {OF_PICTURES}",
    ),
    _light_row(
        *("hot_counts", "Hot pixels, unknown", "counts of a hot pixel", ""),
        "[0] 30 100 (300) 1000 3000 (10000) 100000",
        shoot=_counting(_unknown_hot),
        log=True,
        note=f"White counts 10,000. {OF_PICTURES}",
    ),
    _light_row(
        *("hot_pixels", "Hot pixels, known", "share of pixels", ""),
        "[0] 0.001 0.003 (0.01) 0.03 (0.1) 0.2 0.4",
        shoot=_counting(_hot),
        note=f"They count five times what white does. {OF_PICTURES}",
    ),
    _light_row(
        *("photons", "Photons", "photons of white", ""),
        "1 3 (10) 30 (100) 300 1000 3000 [10000]",
        shoot=_counting(lambda _judge, _scene, n: PictureSetting(photons=n), with_chi2=False),
        log=True,
        rivals=("bare", "bare net"),
        note="The array without a plate has as many photons in its pixels, and its own linear "
        "estimate.",
    ),
    _light_row(
        *("sbr", "Signal over background", "SBR", ""),
        "0.01 0.03 (0.1) 0.3 (1) 3 10 [1000]",
        shoot=_counting(
            lambda _judge, _scene, sbr: PictureSetting(sbr=sbr, photons=FEW_PHOTONS),
            with_chi2=False,
        ),
        log=True,
        rivals=("bare", "bare net"),
        note="1000 photons of white; the mean of the background is taken off like dark counts.",
    ),
    _light_row(
        *("wrong_photons", "Wrong level of photons", "told over true photons", ""),
        "(0.1) 0.2 0.5 0.8 [1] 1.25 2 5 (10)",
        shoot=_counting(
            lambda _judge, _scene, white_factor: PictureSetting(
                photons=FEW_PHOTONS, white_factor=white_factor
            )
        ),
        log=True,
        rivals=("bare", "bare net", "bicubic", "linear"),
        note="1000 photons of white. The linear estimate needs no such number, so networks are "
        "held against it. chi^2 is the squared error over that on 10,000 photons, told right.",
    ),
)

PLATE: Final = (
    _light_row(
        *("active_area", "Active area", "diameter_um", "um"),
        "(20) 24 27 [30] 33 36 (40)",
        shoot=_counting(_active_area),
        note=f"Photons go with the area. {OF_PICTURES}",
    ),
    _light_row(
        *("defocus", "Defocus", "defocus_mm", "mm"),
        "[0] 0.05 0.1 (0.2) 0.3 0.4 0.6 0.8 (1)",
        shoot=_through_kernel(_defocused, bare_too=True),
        note="A round stop of 14 mm before 50 mm; the array without a plate is as far out of "
        f"focus. {OF_PICTURES}",
    ),
    _light_row(
        *("etch_depth", "Depth of etching", "depth_error_percent", "%"),
        "[0] 2 5 8 (10) 12 15 20 (30)",
        shoot=_through_kernel(
            lambda kernel, _camera, percent: etched(kernel, LEVELS, percent / 100)
        ),
        note="All depths of a plate of 8 levels are off by one factor; too flat is alike. "
        f"{OF_PICTURES}",
    ),
    _light_row(
        *("plate_rotation", "Rotation of the plate", "rotation_deg", "deg"),
        "[0] 1 2 3 (4) 5 6 8 (10)",
        shoot=_through_kernel(lambda kernel, _camera, deg: turned(kernel, math.radians(deg))),
        note=OF_PICTURES,
    ),
    _light_row(
        *("plate_shift", "Shift of the plate", "shift_mm", "mm"),
        "(-2) -1 -0.5 [0] 0.5 1 (2)",
        shoot=_counting(_shifted_plate),
        note="Along both axes. The light of every dot gets a phase alone; what is modelled is the "
        "light of a square stop, 14 mm wide and dark beside the plate, that no longer goes "
        f"through it. {OF_PICTURES}",
    ),
    _light_row(
        *("sample_phase", "Phase of the sample", "shift", "sub-pixels"),
        "-2 (-1) -0.5 -0.25 -0.1 [0] 0.1 0.25 (0.5) 1",
        shoot=_through_kernel(
            lambda kernel, _camera, shift: shift_kernel(kernel, -shift), bare_too=True
        ),
        note="Along both axes; -2, -1 and 1 are the phases 0, 1 and 3 where the bundle says 2. The "
        f"picture lies as far beside its place, which alone is most of the error. {OF_PICTURES}",
    ),
)

TIMES: Final = (
    _depth_row(
        *("depth_hot", "Depth: hot pixels", "share of pixels", ""),
        "[0] 0.003 (0.01) 0.03 (0.1) 0.2 0.4",
        shoot=_hot_scan,
        note="A hot pixel counts 50 more in every bin. Sub-pixels of hot pixels are not believed. "
        f"{OF_DEPTH}",
    ),
    _depth_row(
        *("depth_photons", "Depth: photons", "signal photons of a pixel", ""),
        "1 3 (10) 20 (30) 60 100 300 [1000] 10000",
        shoot=_scanning(lambda _axis, _pulse, photons: DepthSetting(photons=photons)),
        log=True,
        note=f"SBR 3. {OF_DEPTH}",
    ),
    _depth_row(
        *("depth_sbr", "Depth: signal over background", "SBR", ""),
        "0.01 (0.03) 0.1 0.2 (0.3) 1 [3] 10",
        shoot=_scanning(lambda _axis, _pulse, sbr: DepthSetting(sbr=sbr)),
        log=True,
        note=f"1000 signal photons of a pixel on average. {OF_DEPTH}",
    ),
    _depth_row(
        *("gate_rc", "Depth: time constant of the gate", "true over stated time constant", ""),
        "0.1 0.25 (0.5) 0.8 0.9 [1] 1.1 1.25 (1.5) 2 4",
        shoot=_scanning(lambda axis, pulse, rc: _through_gate(axis, pulse, rc=rc)),
        log=True,
        note=OF_DEPTH,
    ),
    _depth_row(
        *("gate_width", "Depth: width of the gate", "true over stated width", ""),
        "0.5 0.8 (0.9) 0.95 0.98 [1] 1.02 1.05 (1.1) 1.25 2",
        shoot=_scanning(lambda axis, pulse, width: _through_gate(axis, pulse, width=width)),
        log=True,
        note=f"All times move alike; [correction] offset_ps would take that off. {OF_DEPTH}",
    ),
    _depth_row(
        *("orientation", "Depth: orientation", "orientation", ""),
        "[0] (1)",
        shoot=_scanning(_turned_round),
        labels=("as it is", "the other"),
        note=OF_DEPTH,
    ),
    _depth_row(
        *("pile_up", "Depth: pile-up, gate scan", "chance of the brightest bin", ""),
        "[0.01] 0.05 0.1 0.2 (0.45) 0.7 0.85 (0.95)",
        shoot=_scanning(
            lambda axis, _pulse, chance: DepthSetting(
                axis=replace(axis, orientation="gate"), chance=chance
            )
        ),
        log=True,
        note=_PILE_UP,
    ),
    _depth_row(
        *("pile_up_free", "Depth: pile-up, free running", "chance of the brightest bin", ""),
        "[0.01] 0.05 0.1 (0.2) 0.3 0.45 0.7 (0.95)",
        shoot=_scanning(
            lambda axis, _pulse, chance: DepthSetting(
                axis=replace(axis, orientation="histogram"), chance=chance
            )
        ),
        log=True,
        note=_PILE_UP,
    ),
    _depth_row(
        *("two_returns", "Depth: two surfaces", "apart_ps", "ps"),
        "25 (50) 75 100 150 (200) 400 600 [900]",
        shoot=_scanning(
            lambda _axis, _pulse, gap_ps: DepthSetting(photons=TWO_PHOTONS, behind_ps=gap_ps)
        ),
        note="4000 signal photons of a pixel on average, over both surfaces. The nearer surface "
        "is judged; a way is broken where it finds both, within 100 ps and half of what they lie "
        "apart, in less than half of the middle.",
    ),
)

SCENARIOS: Final = (*LIGHT, *PLATE, *TIMES)
