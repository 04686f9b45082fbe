"""Laws of pictures of photons, held against a bundle: see camkit/runtime/proof/laws.

even     an even scene stays even: its mean, and no more unevenness than its photons have
black    no sub-pixel is black where light was counted
double   twice the light gives twice the photons
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import SuperResolve
from camkit.bundle.stages.super_resolve import SURE
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.twin.counting import Disturbances, count_frames
from camkit.runtime.kinds.spad.twin.photon_twin import fitted, luminance, seen_by
from camkit.runtime.proof.laws.law import SHARE, Law
from camkit.scenes.scene_register import named_scene

PHOTONS: Final = (30.0, 300.0, 3000.0, 1e5)
"""Of white."""
SCENES: Final = ("procedural:7", "procedural:11", "night:3")
EVEN: Final = 0.01
UNEVEN: Final = 1.0
BLACK: Final = 1e-4
DOUBLE: Final = 0.01
BLOCK_PX: Final = 8
FRAMES: Final = 16


def photon_laws(bundle: Bundle, size: str | None, threads: int) -> tuple[Law, ...] | str:
    """Measure the laws of pictures of photons for one size of a bundle.

    Args:
        bundle: The camera.
        size: Of its networks; None for a bundle without any.
        threads: To compute with.

    Returns:
        The laws, or why none can be held.
    """
    if bundle.manifest.stage(SuperResolve) is None:
        return "it makes no picture of photons finer"
    if not bundle.manifest.is_trained:
        return "its weights are random"
    camera = FineCamera.of(bundle, threads)
    if size is not None and size not in camera.sizes:
        return f"it holds no network of size {size}"
    return (*_even(camera, size), _black(camera, size), _double(camera, size))


def _counts(camera: FineCamera, light: FloatArray, photons: float, frames: int = 1) -> FloatArray:
    mean = seen_by(camera, light[None]) * photons
    rng = np.random.default_rng(9)
    return np.concatenate(
        [count_frames(mean, Disturbances(), rng).astype(np.float32) for _ in range(frames)]
    )


def _fine_shape(camera: FineCamera) -> tuple[int, int]:
    sensor = camera.sensor
    return camera.scale * sensor.height_px, camera.scale * sensor.width_px


def _even(camera: FineCamera, size: str | None) -> tuple[Law, Law]:
    """Photograph even scenes: the mean, and the spread of sub-pixels over that of their photons."""
    worst_shift, uneven = 0.0, 0.0
    where = ["", ""]
    for photons in PHOTONS:
        counts = _counts(camera, np.full(_fine_shape(camera), 0.5, np.float32), photons, FRAMES)
        pictures = finer_frames(camera, counts, 0.0, size)
        mean = float(counts.mean())
        shift = abs(float(pictures.mean()) - mean) / mean
        spread = float(pictures.std(axis=0).mean() / np.sqrt(mean))
        if shift > worst_shift:
            worst_shift, where[0] = shift, f"{photons:g} photons of white"
        if spread > uneven:
            uneven, where[1] = spread, f"{photons:g} photons of white"
    return (
        Law(name="even_mean", worst=worst_shift, limit=EVEN, unit=SHARE, where=where[0]),
        Law(name="even_spread", worst=uneven, limit=UNEVEN, unit="times", where=where[1]),
    )


def _black(camera: FineCamera, size: str | None) -> Law:
    """Count black sub-pixels amid pixels that all counted light for sure."""
    worst, where = 0.0, ""
    for name in SCENES:
        light = fitted(luminance(named_scene(name, *_fine_shape(camera))), camera)
        for photons in PHOTONS:
            counts = _counts(camera, light, photons)
            picture = finer_frames(camera, counts, 0.0, size)[0]
            sure = counts[0] > SURE * np.sqrt(counts[0] + 1)
            lit = np.kron(_all_around(sure), np.ones((camera.scale,) * 2)).astype(bool)
            share = float(np.mean(picture[lit] <= 0)) if lit.any() else 0.0
            if share > worst:
                worst, where = share, f"{name}, {photons:g} photons of white"
    return Law(name="black", worst=worst, limit=BLACK, unit=SHARE, where=where)


def _all_around(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where all 3x3 pixels around are true."""
    wide = np.pad(mask, 1, mode="edge")
    height, width = mask.shape
    parts = [wide[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(np.logical_and.reduce(parts))


def _double(camera: FineCamera, size: str | None) -> Law:
    """Compare the photons of blocks at two exposures, without noise, in 19 of 20 blocks."""
    light = fitted(luminance(named_scene(SCENES[0], *_fine_shape(camera))), camera)
    mean = seen_by(camera, light[None]).astype(np.float32)
    once, twice = (
        _blocks(finer_frames(camera, mean * np.float32(photons), 0.0, size)[0])
        for photons in (2e4, 4e4)
    )
    error = np.abs(twice - 2 * once) / (2 * once)
    return Law(name="double", worst=float(np.quantile(error, 0.95)), limit=DOUBLE, unit=SHARE)


def _blocks(picture: FloatArray) -> FloatArray:
    height, width = (side // BLOCK_PX for side in picture.shape)
    whole = picture[: height * BLOCK_PX, : width * BLOCK_PX]
    return np.asarray(whole.reshape(height, BLOCK_PX, width, BLOCK_PX).mean(axis=(1, 3)))


LAWS: Final = photon_laws
