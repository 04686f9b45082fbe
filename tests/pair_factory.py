"""Two pictures of one plane through a lens, wide and sharp, rendered apart from what is tested.

A scene on a grid three times as fine is convolved with traced kernels of the axis, then averaged
over the pixels: the field is small, so that one kernel holds everywhere.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from camkit.calibrate import PairWords
from camkit.models_def.face.recipe_writing import with_fields_of
from camkit.models_def.optics.kernel_bank import colour_kernels, gaussian_response, wavelength_grid
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.lens_file.placing import Placement, placed_lens, stopped_lens
from camkit.models_def.sensors.sensor_choice import choose_sensor
from camkit.runtime.signal.tone_curve import Tone

LENS = "double-gauss"
FINE = 3
PITCH_UM = 30.0
SIZE = (192, 256)
WORDS = PairWords(focus_m=1.0, object_m=1.35, f_number=4.0, sharp_f_number=20.0, pitch_um=PITCH_UM)


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """The circumstances that nobody states."""

    origin: str = "vertex"
    defocus_mm: float = 0.0
    tone: Tone | None = None


def write_pair(
    folder: Path, truth: Truth, *, object_m: float = 1.35, seed: int = 0, noise: float = 0.002
) -> list[Path]:
    """Write wide.png and sharp.png of a plane."""
    placement = Placement(
        f_number=WORDS.f_number,
        focus_mm=1e3 * WORDS.focus_m,
        objects_mm=(1e3 * object_m,),
        origin=truth.origin,  # type: ignore[arg-type]
        defocus_mm=truth.defocus_mm,
    )
    sensor = choose_sensor(f"{SIZE[1]}x{SIZE[0]}@{PITCH_UM:g}um:planes")
    placed = placed_lens(with_fields_of(find_lens(LENS), sensor), placement)
    wide = replace(placed.lens, object_distance_mm=placed.objects_mm[0])
    sharp = stopped_lens(wide, f_number=WORDS.sharp_f_number, stop_radius_mm=None)
    scene = _scene(seed)
    rng = np.random.default_rng(seed + 1)
    tone = truth.tone or Tone(name="srgb")
    paths = []
    for name, lens in (("wide", wide), ("sharp", sharp)):
        kernels, energy = colour_kernels(
            lens,
            gaussian_response(wavelength_grid(7)),
            np.zeros(1),
            size_px=95,
            pitch_um=PITCH_UM / FINE,
            rays=2048,
        )
        assert energy > 0.99
        light = np.stack(
            [fftconvolve(p, k, "same") for p, k in zip(scene, kernels[0], strict=True)]
        )
        margin = light.shape[1] - SIZE[0] * FINE
        light = light[:, margin // 2 :, margin // 2 :][:, : SIZE[0] * FINE, : SIZE[1] * FINE]
        pixels = light.reshape(3, SIZE[0], FINE, SIZE[1], FINE).mean((2, 4))
        pixels = pixels + rng.normal(0, noise, pixels.shape)
        paths.append(folder / f"{name}.png")
        write_codes(paths[-1], codes_of(np.clip(pixels, 0, 1), tone))
    return paths


def codes_of(light: NDArray[np.float64], tone: Tone) -> NDArray[np.uint8]:
    """Return 8-bit codes of light."""
    codes = np.linspace(0, 1, 4096)
    return np.rint(255 * np.interp(light, tone.light_at(codes), codes)).astype(np.uint8)


def write_codes(path: Path, codes: NDArray[np.uint8]) -> None:
    """Write (3, h, w) RGB as PNG."""
    cv2.imwrite(str(path), np.ascontiguousarray(codes[::-1].transpose(1, 2, 0)))


def _scene(seed: int) -> NDArray[np.float64]:
    """Return rectangles and grain of many sizes on the fine grid, with a margin."""
    rng = np.random.default_rng(seed)
    height, width = (FINE * (side + 48) for side in SIZE)
    scene = np.full((3, height, width), 0.35)
    for _ in range(900):
        y, x = rng.integers(0, height), rng.integers(0, width)
        tall, wide = rng.integers(3, 90, 2)
        scene[:, y : y + tall, x : x + wide] = rng.uniform(0.05, 0.9, 3)[:, None, None]
    return scene
