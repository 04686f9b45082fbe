"""Light on the sensor, and what the sensor makes of it: exposure, noise, levels, defects."""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.report.stress.scenario import row
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot, spoil
from camkit.report.stress.taking import set_to, showing
from camkit.runtime.twin.exposure import Setting

RADIUS_PX: Final = 8.0
POWER: Final = 8.0
COLOUR: Final = (0.9, 0.5, 0.4)
FILE_BITS: Final = 16


def _stated_black(judge: Judge, scene: Scene, value: float) -> Shot:
    """Change the black level that is stated: warm electronics, another setting."""
    shot = judge.rig.shoot(scene)
    black, white = shot.capture.black_level, shot.capture.white_level
    shifted = black + np.float32(value / 100) * (np.float32(white) - black)
    return replace(shot, capture=replace(shot.capture, black_level=shifted.astype(np.float32)))


def with_discs(scene: Scene, radius_px: float, count: int) -> Scene:
    """Return a scene with soft-edged white discs of `POWER` times white at random places.

    Args:
        scene: The scene.
        radius_px: In pixels of the sensor.
        count: Number of discs.
    """
    rng = np.random.default_rng(7_100 + scene.number)
    radius = radius_px * scene.scale
    height, width = scene.linear.shape[1:]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    cover = np.zeros((height, width), np.float32)
    for _ in range(count):
        cy, cx = rng.random() * height, rng.random() * width
        cover = np.maximum(cover, np.clip(radius + 0.5 - np.hypot(y - cy, x - cx), 0, 1))
    linear = scene.linear + cover * (np.float32(POWER) - scene.linear)
    return scene.showing(linear, f"{scene.name}+{count}x{radius_px:g}")


def _lamps(scene: Scene, percent: float) -> Scene:
    """Return a scene so much of which lies under small discs; itself where none does."""
    area = scene.size_px[0] * scene.size_px[1]
    count = round(percent / 100 * area / (np.pi * RADIUS_PX**2))
    return with_discs(scene, RADIUS_PX, count) if count else scene


def _dead(judge: Judge, scene: Scene, value: float) -> Shot:
    """Set samples to black or to white."""
    shot = judge.rig.shoot(scene)
    return spoil(shot, value, (np.floor(shot.capture.white_level), 0), seed=7_200)


def _invalid(judge: Judge, scene: Scene, value: float) -> Shot:
    """Write NaN and infinities into a float capture."""
    return spoil(judge.rig.shoot(scene), value, (np.nan, np.inf, -np.inf), seed=7_300)


def _flat(judge: Judge, scene: Scene, value: float) -> Shot:
    """Photograph a constant coloured field, on which some networks explode."""
    field = np.ones_like(scene.linear) * np.array(COLOUR, np.float32)[:, None, None]
    flat = scene.showing(field, f"flat/{scene.name}")
    return judge.rig.shoot(flat, setting=Setting(exposure=2.0**value))


def _averaged(judge: Judge, scene: Scene, value: float) -> Shot:
    """Average many frames into one file, which states its noise."""
    shot = judge.rig.shoot(scene, setting=Setting(noise_factor=value**-0.5, bits=FILE_BITS))
    return replace(shot, capture=replace(shot.capture, noise=shot.noise))


SCENARIOS: Final = (
    row(
        *("bit_depth", "Bit depth", "bits", "bit"),
        "5 6 7 (8) 10 [12] 14",
        shoot=set_to(lambda bits: Setting(bits=round(bits))),
        bounds={"bit_depth": "low"},
        note="Black keeps its share of the range; the file states levels, not the steps' noise.",
    ),
    row(
        *("black_level", "Black level", "black_error_percent", "%"),
        "-3 (-1) -0.3 -0.1 [0] 0.1 0.3 (1) 3",
        shoot=_stated_black,
        note="The file states a black that lies so much of the way to white above the true one; "
        "below 0 all is brighter than it was. Nothing tells the methods, nor the input.",
    ),
    row(
        *("blob_size", "Size of a clipped light", "radius_px", "px"),
        "[2] 5 10 20 (40) 80",
        shoot=showing(lambda scene, px: with_discs(scene, px, 1), away_from_clipped=True),
        log=True,
        note="One disc 8 times white; judged away from what clipped.",
    ),
    row(
        *("dead_pixels", "Dead and hot pixels", "dead_percent", "%"),
        "[0] 0.01 0.03 0.1 0.3 (1) 3",
        shoot=_dead,
        log=True,
        bounds={"broken_fraction": "high"},
        note="Half of them stuck at black, half at white.",
    ),
    row(
        *("exposure", "Exposure", "exposure_ev", "EV"),
        "(-6) -5 -4 -3 -2 -1 [0] 1 (2) 3 4 6",
        shoot=set_to(lambda ev: Setting(exposure=2.0**ev), away_from_clipped=True),
        bounds={"signal_level": "both", "clipped_fraction": "high"},
        note="At ISO 100, judged away from clipped pixels and at the brightness of the scene: a "
        "method that is not linear in the light loses here.",
    ),
    row(
        *("flat_field", "Constant fields, down to black", "level_ev", "EV"),
        "(-14) -10 -8 -6 -4 -2 [0]",
        shoot=_flat,
        rival=False,
        note="A field of one colour with noise. Blur does no harm here, so doing nothing wins; a "
        "method breaks if what it gives does not explain the capture, or is not bounded.",
    ),
    row(
        *("frame_average", "Frames averaged", "frames", "frames"),
        "[1] 4 16 (64) 256",
        shoot=_averaged,
        log=True,
        bounds={"grey_noise": "low"},
        note="At ISO 100; the file has 16 bits and states its noise.",
    ),
    row(
        *("invalid_pixels", "NaN and infinite pixels", "invalid_percent", "%"),
        "[0] 0.01 0.03 0.1 0.3 (1) 3",
        shoot=_invalid,
        log=True,
        bounds={"broken_fraction": "high"},
        note="Half NaN, a quarter each of the infinities, in a float mosaic.",
    ),
    row(
        *("noise", "Noise: sensitivity", "iso", "ISO"),
        "50 [100] 400 1600 3200 6400 (12800) 25600",
        shoot=set_to(lambda iso: Setting(iso=iso)),
        log=True,
        bounds={"grey_noise": "both"},
        note="The picture is equally bright at every ISO; the file states the ISO. Below the "
        "lowest ISO of a sensor its noise stays: such a camera only exposes longer.",
    ),
    row(
        *("noise_above_stated", "Noise above what the file states", "noise_factor", "x"),
        "[1] 1.5 2 3 (4) 8",
        shoot=set_to(lambda factor: Setting(iso=400.0, noise_factor=factor)),
        log=True,
        note="At ISO 400; the factor is on the standard deviation of all noise, and no method is "
        "told.",
    ),
    row(
        *("saturated_area", "Saturated area", "saturated_percent", "%"),
        "[0] 0.3 1 (3) 6 10",
        shoot=showing(_lamps, away_from_clipped=True),
        bounds={"clipped_fraction": "high"},
        note="Discs of 8 px radius, 8 times white; judged away from what clipped.",
    ),
)
