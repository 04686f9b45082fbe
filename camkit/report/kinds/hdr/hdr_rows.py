"""The scenarios of snapshot HDR cameras: lights of another kind, hidden streaks, a plate turned.

All are judged by `camkit.report.kinds.hdr.judge`: a method that ends more than half a decibel
below the developed picture of the bare lens, at less than 65 dB, breaks.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot
from camkit.report.kinds.hdr.lights import (
    dimmed,
    stretched,
    turned,
    with_colour,
    with_lamp,
    with_line,
    with_peak,
    writes_streaks,
)
from camkit.report.stress.scenario import Shoot, row
from camkit.report.stress.scene import Scene
from camkit.runtime.twin.exposure import Setting
from camkit.streaks import StreakOptics

BLOB_POWER: Final = 64.0
POWER: Final = 128.0
RING_PX: Final = 72
NEAREST_PX, FARTHEST_PX = 8.0, 64.0
OUTSIDE_PX: Final = 4.0
COLOURS: Final = {
    "as it is": None,
    "white": (1.0, 1.0, 1.0),
    "red": (1.0, 0.02, 0.02),
    "amber": (1.0, 0.38, 0.02),
    "green": (0.02, 1.0, 0.1),
    "blue": (0.02, 0.1, 1.0),
}
"""Linear Rec.709 of the lights; where none exceeds white the scene is as it is."""
LAMP_PX: Final = 6.0
PANEL_FROM_PX: Final = 12.0
WIDEST: Final = 0.3
"""Of the shorter side: where a panel ends at the latest."""
PANEL: Final = 3.0
"""Times white: it clips in every colour."""
LINES: Final = 6


def _set_to(setting: Callable[[float], Setting]) -> Shoot:
    """Return what photographs the lights of a scene with a setting of the camera."""

    def shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
        return judge.shoot(judge.lit(scene), setting=setting(value))

    return shoot


def _through_streaks(change: Callable[[StreakOptics, float], StreakOptics]) -> Shoot:
    """Return what photographs the lights of a scene behind changed streaks; at 0 as they are."""

    def shoot(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
        streaks = judge.rig.bundle.streaks
        lens = judge.lens_of(change(streaks, value)) if value else None
        return judge.shoot(judge.lit(scene), lens=lens)

    return shoot


def _one_lamp(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    dark = dimmed(judge.lit(scene).linear)
    height, width = dark.shape[1:]
    rng = np.random.default_rng(7_200 + scene.number)
    centre = rng.uniform(0.3, 0.7) * height, rng.uniform(0.3, 0.7) * width
    lamp = with_lamp(dark, centre, value * scene.scale, BLOB_POWER)
    return judge.shoot(scene.showing(lamp, f"{scene.name} lamp {value:g}"))


def _surrounded(scene: Scene, lit: FloatArray, lamps: int) -> FloatArray:
    """Return a scene and what lies around it: its mirror image, and lamps."""
    ring, scale = RING_PX * scene.scale, scene.scale
    canvas = np.pad(lit, ((0, 0), (ring, ring), (ring, ring)), mode="symmetric")
    height, width = lit.shape[1:]
    rng = np.random.default_rng(7_300 + scene.number)
    for _ in range(lamps):
        distance_px = scale * rng.uniform(NEAREST_PX, FARTHEST_PX)
        share = rng.uniform(0.1, 0.9)
        sides = (
            (-distance_px, share * width),
            (height + distance_px, share * width),
            (share * height, -distance_px),
            (share * height, width + distance_px),
        )
        y, x = sides[int(rng.integers(4))]
        canvas = with_lamp(canvas, (y + ring, x + ring), scale * OUTSIDE_PX, POWER)
    return canvas


def _lamps_outside(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    return judge.shoot(lit, surroundings=_surrounded(scene, lit.linear, round(value)))


def _peak(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    return judge.shoot(lit.showing(with_peak(lit.linear, value), f"{lit.name} peak {value:g}"))


def _one_colour(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    name, colour = list(COLOURS.items())[int(value)]
    if colour is None:
        return judge.shoot(lit)
    return judge.shoot(lit.showing(with_colour(lit.linear, colour), f"{lit.name} {name}"))


def _panelled(dark: FloatArray, share: float, to_px: float, scale: int) -> FloatArray:
    """Return scene with a lamp in its middle, and a panel over a share of the circle around it."""
    height, width = dark.shape[1:]
    middle = (height - 1) / 2, (width - 1) / 2
    y, x = np.ogrid[:height, :width]
    radius_px = np.hypot(y - middle[0], x - middle[1])
    turn = np.arctan2(y - middle[0], x - middle[1]) / (2 * np.pi) % 1
    panel = (radius_px > PANEL_FROM_PX * scale) & (radius_px <= to_px) & (turn < share)
    return with_lamp(np.where(panel, np.float32(PANEL), dark), middle, LAMP_PX * scale, POWER)


def _hidden_streaks(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    dark = dimmed(judge.lit(scene).linear)
    to_px = min(judge.rig.bundle.streaks.reach_px * scene.scale, WIDEST * min(dark.shape[1:]))
    linear = _panelled(dark, value / 100, to_px, scene.scale)
    return judge.shoot(scene.showing(linear, f"{scene.name} panel {value:g}"))


def _lined(judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    lit = judge.lit(scene)
    if value == 0:
        return judge.shoot(lit)
    streaks, linear = judge.rig.bundle.streaks, lit.linear
    rng = np.random.default_rng(7_400 + scene.number)
    places = np.argwhere(linear.max(axis=0) > 1)
    for _ in range(LINES):
        y, x = places[rng.integers(len(places))]
        angle_rad = float(rng.choice(streaks.angles_rad))
        reach_px = float(streaks.reach_px * scene.scale)
        linear = with_line(linear, (float(y), float(x)), angle_rad, reach_px, value / 100)
    return judge.shoot(lit.showing(linear, f"{lit.name} lines {value:g}"))


_hdr_row = partial(row, applies=writes_streaks, rival=False)

SCENARIOS: Final = (
    _hdr_row(
        *("bit_depth", "Bit depth", "bits", "bit"),
        "(8) 10 [12] 14",
        shoot=_set_to(lambda bits: Setting(bits=round(bits))),
        bounds={"bit_depth": "low"},
        note="Lights of 1.5 % of the picture. Faint streaks are less than a step of 8 bits.",
    ),
    _hdr_row(
        *("blob_size", "Size of a clipped light", "radius_px", "px"),
        "[5] 10 20 (40) 80",
        shoot=_one_lamp,
        log=True,
        note="One round lamp 64 times white in a dark scene.",
    ),
    _hdr_row(
        *("light_outside", "Lamps outside the picture", "lamps", ""),
        "[0] 1 2 (4) 8",
        shoot=_lamps_outside,
        note="Round lamps of 4 px radius, 128 times white, 8 to 64 px beside the border. Beyond "
        "it the scene goes on as its mirror image.",
    ),
    _hdr_row(
        *("noise", "Noise: sensitivity", "iso", "ISO"),
        "[100] 400 1600 (6400) 25600",
        shoot=_set_to(lambda iso: Setting(iso=iso)),
        log=True,
        bounds={"grey_noise": "both"},
        note="Lights of 1.5 % of the picture, equally bright at every ISO; the file states the "
        "ISO.",
    ),
    _hdr_row(
        *("peak", "Brightest light", "peak", "x white"),
        "2 (4) 8 16 32 64 128 [256] 512 1024 2048 (4096)",
        shoot=_peak,
        log=True,
        note="The same lights, the logarithm of their brightness scaled. PSNR has the peak 2^8 "
        "throughout.",
    ),
    _hdr_row(
        *("plate_rotation", "Rotation of the plate", "rotation_deg", "deg"),
        "[0] 0.25 0.5 (1) 1.5 2",
        shoot=_through_streaks(lambda streaks, deg: turned(streaks, math.radians(deg))),
        note="The methods have the arms as the bundle states them.",
    ),
    _hdr_row(
        *("saturated_area", "Saturated area", "saturated_percent", "%"),
        "(0.3) 1 [1.5] 3 6 (10)",
        shoot=lambda judge, scene, percent: judge.shoot(judge.lit(scene, percent / 100)),
        log=True,
        bounds={"clipped_fraction": "high"},
        note="Of the scene, by its exposure; lights end at 2^8 times white.",
    ),
    _hdr_row(
        *("single_colour", "Lights of one colour", "colour", ""),
        "[0] 1 (2) 3 4 (5)",
        shoot=_one_colour,
        labels=tuple(COLOURS),
        note="What exceeds white gets the colour, as bright as its strongest component was.",
    ),
    _hdr_row(
        *("streak_clipping", "Streaks on clipped ground", "hidden_percent", "%"),
        "[0] 10 25 (50) 75",
        shoot=_hidden_streaks,
        note="One lamp 128 times white; a panel 3 times white hides so much of the circle around "
        "it, as far as its arms reach or 0.3 of the picture's side.",
    ),
    _hdr_row(
        *("streak_like_edges", "Edges that look like streaks", "line_percent", "%"),
        "[0] 2 5 (10) 20 50",
        shoot=_lined,
        note="Six lines of the scene itself, through clipped places, along arms and as long as "
        "they; so many per cent of white.",
    ),
    _hdr_row(
        *("wrong_depth", "Focus at another distance", "length_percent", "%"),
        "-10 (-5) -2 [0] 2 (5) 10",
        shoot=_through_streaks(lambda streaks, percent: stretched(streaks, 1 + percent / 100)),
        note="By so much the arms are longer than the bundle says. A 50 mm lens refocused from 5 "
        "m to 1 m makes them 4.2 % longer, one refocused to infinity 1 % shorter.",
    ),
)
