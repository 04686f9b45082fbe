"""The scene is known to the last pixel, so that whatever else a picture shows was added."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.report.limb import limb_errors
from camkit.report.satellites import satellites
from camkit.report.stress.scenario import has_room, row
from camkit.report.stress.scene import Scene
from camkit.report.stress.taking import examined, showing
from camkit.scenes.clean import Disc, disc_on_black, star_field

DISC_SEED: Final = 7_600
STAR_SEED: Final = 7_500
SKY: Final = 1e-3
RADIUS_SHARE: Final = 0.3
"""Of a disc, of the shorter side of a scene."""
PITCH_PX: Final = 40
"""Cells of stars: 30 px lie between two at least."""


def moonlit(scene: Scene, light: float) -> Scene:
    """Return a disc on black in place of a scene.

    Args:
        scene: The scene.
        light: Of the disc, 1 the white.
    """
    rng = np.random.default_rng(DISC_SEED + scene.number)
    height, width = scene.linear.shape[1:]
    y, x = (float(side / 2 + rng.uniform(-4, 4)) for side in (height, width))
    disc = Disc(center_px=(y, x), radius_px=RADIUS_SHARE * min(height, width) + rng.uniform(-4, 4))
    linear = disc_on_black(rng, (height, width), disc, light=light, sky=SKY)
    return scene.showing(linear, f"limb/{light:g}/{scene.name}")


def limb_numbers(picture: FloatArray, truth: FloatArray) -> dict[str, float]:
    """Return what is wrong with a limb as a report has it."""
    errors = limb_errors(picture, truth)
    return {
        "wobble_px": errors.wobble_px,
        "seam_percent": 100 * errors.seam,
        "rim_percent": 100 * errors.rim,
    }


def starry(scene: Scene, light: float) -> Scene:
    """Return lone stars in place of a scene.

    Args:
        scene: The scene.
        light: Of the brightest pixel of a star, 1 the white.
    """
    rng = np.random.default_rng(STAR_SEED + scene.number)
    height, width = scene.linear.shape[1:]
    linear = star_field(rng, (height, width), light=light, sky=SKY, pitch_px=PITCH_PX)
    return scene.showing(linear, f"stars/{light:g}/{scene.name}")


def star_numbers(picture: FloatArray, truth: FloatArray) -> dict[str, float]:
    """Return the satellites of a scene as a report has them."""
    spots = satellites(picture, truth)
    satellite_light = {
        f"satellites_{part}_{rank}_percent": 100 * float(np.quantile(shares, share))
        for part, shares in (("above", spots.above), ("below", spots.below))
        for rank, share in (("median", 0.5), ("p90", 0.9))
    }
    return satellite_light | {"core_median_percent": 100 * float(np.median(spots.core))}


SCENARIOS: Final = (
    row(
        *("limb", "Limb of a disc on black", "disc_light", "x white"),
        "(0.05) 0.2 [0.6]",
        shoot=showing(moonlit),
        measure=examined(showing(moonlit), limb_numbers),
        log=True,
        applies=has_room,
        note="A disc on a sky of 0.1 % of white. Wobble: standard deviation along the limb of "
        "where the picture falls through half of the step, in waves of at most 48 px, the truth's "
        "own taken off. Light must fall all the way out; seam and rim: how far it rises again "
        "outside and inside of the limb, in percent of the step, mean of 16 sectors and of the "
        "colours.",
    ),
    row(
        *("stars", "Satellites around stars", "star_light", "x white"),
        "0.1 0.4 [1.6] (6.4)",
        shoot=showing(starry),
        measure=examined(showing(starry), star_numbers),
        log=True,
        applies=has_room,
        note="Lone stars on a sky of 0.1 % of white. Satellites: light above, and apart light "
        "below the sky around a star, 3 to 12 px from it, in percent of the star's true light, "
        "all colours added up; median and 90th percentile over the stars. Core: the light up to "
        "3 px. The light of the input around it is blur.",
    ),
)
