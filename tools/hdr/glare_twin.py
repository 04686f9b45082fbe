"""A night scene behind a wiped windshield: a two-point star through every light.

    python -m tools.hdr.glare_twin night:3 -o windshield.exr --truth clean.exr

The star of Sun 2021, section 5.7.1, after Rouf et al. 2011: the light itself stays whole, the
streaks are added to it. As optics, core 1, two opposite arms, no haze.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
import scipy.signal

from camkit.arrays import FloatArray
from camkit.errors import CamkitError, ContractError
from camkit.runtime.twin.truth import write_truth
from camkit.scenes import named_scene
from camkit.scenes.saturation import saturating_exposure, with_exposure
from camkit.streaks import SECTION_STEP_PX, StreakOptics

REACH_PX: Final = 160
SHARE: Final = 0.06
SATURATED: Final = 0.015
READ_NOISE: Final = 0.002
SHOT_NOISE: Final = 1e-4
STEPS: Final = 4095
FADING_PER_PX: Final = 0.014
"""m of the thesis."""
Fading = Literal["exponential", "even"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """A photograph through the star, and what it should have been.

    Attributes:
        picture: (3, h, w) float32: clips at 1, with noise, in steps of 12 bits.
        truth: (3, h, w) float32: the scene without streaks, clipped at 1.
    """

    picture: FloatArray
    truth: FloatArray


def two_point_star(
    angle_rad: float, fading: Fading = "exponential", share: float = SHARE
) -> StreakOptics:
    """Return optics: two arms, `angle_rad` from the vertical, of a share of the light in all."""
    distance = np.arange(REACH_PX + 1, dtype=np.float64)
    profile = np.exp(-FADING_PER_PX * distance) if fading == "exponential" else distance * 0 + 1
    profile *= share / (2 * profile.sum())
    offset = SECTION_STEP_PX * np.arange(-4, 5)
    section = np.clip(1 - np.abs(offset), 0, None)
    core = np.ones((1, 1, 1, 1), np.float32)
    downward_rad = math.pi / 2 - angle_rad
    return StreakOptics(
        core=core,
        bare_core=core,
        profiles=np.broadcast_to(profile, (1, 1, 2, profile.size)).astype(np.float32),
        sections=np.broadcast_to(section, (1, 2, section.size)).astype(np.float32),
        angles_rad=np.array([downward_rad, downward_rad + math.pi]),
        haze=np.zeros((1, 1, 1, 1), np.float32),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([0.55]),
        pixel_pitch_um=1.0,
    )


def exposed_scene(name: str, height: int, width: int) -> FloatArray:
    """Return a scene (3, h, w) exposed so that some of it saturates."""
    scene = named_scene(name, height, width)
    saturation = saturating_exposure(scene, np.eye(3), (1.0, 1.0, 1.0), SATURATED)
    return with_exposure(scene, saturation.exposure)


def photographed(scene: FloatArray, star: StreakOptics | None, seed: int = 0) -> Shot:
    """Photograph a scene through a star, or through nothing.

    Args:
        scene: (3, h, w) float32 linear, may exceed 1.
        star: The optics; None for clean ones.
        seed: Of the noise.
    """
    light = scene
    if star is not None:
        kernel = star.dense()[0, 0]
        light = np.stack([scipy.signal.fftconvolve(c, kernel, mode="same") for c in scene])
    rng = np.random.default_rng(seed)
    sigma = np.sqrt(READ_NOISE**2 + SHOT_NOISE * np.clip(light, 0, 1))
    noisy = np.clip(light + rng.standard_normal(light.shape) * sigma, 0, 1)
    return Shot(
        picture=(np.round(noisy * STEPS) / STEPS).astype(np.float32),
        truth=np.minimum(scene, 1).astype(np.float32),
    )


def psnr_db(picture: FloatArray, shot: Shot, level: float) -> float:
    """Return the PSNR of what is no light, linear, peak 1."""
    dim = shot.picture.max(axis=0) < level
    return float(-10 * np.log10(np.mean((picture - shot.truth)[:, dim] ** 2, dtype=np.float64)))


def main(words: Sequence[str] | None = None) -> None:
    """Write a photograph, linear, and what it should have been.

    Raises:
        SystemExit: If something cannot be drawn or written; says what.
    """
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", help="such as night:3")
    parser.add_argument("-o", "--output", type=Path, required=True, help="photograph (EXR)")
    parser.add_argument("--truth", type=Path, help="the same without streaks and noise (EXR)")
    parser.add_argument("--size-px", type=int, nargs=2, default=(512, 384), metavar=("W", "H"))
    parser.add_argument("--angle", type=float, default=5.0, help="degrees from the vertical")
    arguments = parser.parse_args(words)
    try:
        width, height = arguments.size_px
        scene = exposed_scene(arguments.scene, height, width)
        shot = photographed(scene, two_point_star(math.radians(arguments.angle)))
        files = [(arguments.output, shot.picture), (arguments.truth, shot.truth)]
        for path, picture in files:
            if path is not None:
                write_truth(_new_exr(path), picture)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error


def _new_exr(path: Path) -> Path:
    if path.suffix.lower() != ".exr" or path.exists():
        raise ContractError(f"pictures are written as new files in .exr; got {path}")
    return path


if __name__ == "__main__":
    main()
