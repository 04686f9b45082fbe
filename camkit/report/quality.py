"""Quality of restoration: simulated captures at stated places, judged on sRGB values.

    picture -> place on the sensor -> capture through a lens -> method -> PSNR, SSIM
                                        ^ fabricated copy traced afresh, or the bundle's own PSF

Everything is compared in sensor geometry (distortion stays in, vignetting is divided out), with
the border of `BORDER_PX` cut off.
"""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.golden import IMAGE
from camkit.bundle.reader import Bundle
from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.report.image_scores import peak_signal_noise_ratio, structural_similarity
from camkit.runtime.files.picture import read_light
from camkit.runtime.geometry.sensor_window import centred_origin
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, simulate
from camkit.runtime.twin.truth import light_sensor, picture_scale, true_picture

FIELD_SHARES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Places from centred on the axis to touching the sensor's corner, as shares of that way."""
QUADRANTS: Final = ((1, 1), (-1, 1), (-1, -1), (1, -1))
FABRICATION_SEEDS: Final = (2001, 2002, 2003, 3001, 3002, 3003, 3004, 3005)
"""Of the copies: eight, since three may all be lucky, or one an outlier."""
BORDER_PX: Final = 32
LIGHT_SUFFIXES: Final = (".exr", ".hdr")
"""Pictures that hold linear light, which may exceed white and may be what no camera sees."""
PICTURE_SUFFIXES: Final = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", *LIGHT_SUFFIXES)

FloatGrid = NDArray[np.float64]
PsfSource = Literal["fresh", "bundle"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One capture of the protocol.

    Attributes:
        set_name: Folder of the picture.
        picture: File of the picture.
        number: Its place in the set, sorted by name; decides lens copy and quadrant.
        position: Index into `FIELD_SHARES`.
        iso: Sensitivity.
        psf: Through a fabricated lens traced afresh, or through the bundle's own PSF.
    """

    set_name: str
    picture: Path
    number: int
    position: int
    iso: float
    psf: PsfSource

    @property
    def fabrication_seed(self) -> int:
        """Return the seed of the lens copy."""
        return FABRICATION_SEEDS[self.number % len(FABRICATION_SEEDS)]

    @property
    def noise_seed(self) -> int:
        """Return the seed of the noise, the same for both PSFs and whatever else is run."""
        text = f"{self.set_name}/{self.picture.name}/{self.position}/{self.iso:g}"
        return zlib.crc32(text.encode())


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposed:
    """A capture that was simulated, beside the truth.

    Attributes:
        simulation: Samples and place.
        truths: Product -> what a perfect camera would give, in sensor geometry; for `image`
            (3, h, w) float32 sRGB values.
        extras: What some metrics need or take beside, by name: `linear` (3, h, w) float32, the
            truth of `image` as linear Rec.709, which may exceed white; `clipped` (3, h, w) bool,
            samples that are clipped in the capture; `input` (3, h, w) float32 linear Rec.709, a
            picture that stands as the input in place of the developed capture, such as that of
            an ordinary lens.
    """

    simulation: Simulation
    truths: Mapping[str, FloatArray]
    extras: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def sharp(self) -> FloatArray:
        """Return the truth of the picture."""
        return self.truths[IMAGE]


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Agreement with the sharp picture on sRGB values."""

    psnr_db: float
    ssim: float


def list_set(folder: Path, count: int | None = None) -> tuple[Path, ...]:
    """Return the first pictures of a folder by name.

    Raises:
        ContractError: If there is none.
    """
    if not folder.is_dir():
        raise ContractError(f"there is no folder {folder}; give the folder of the picture sets")
    paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in PICTURE_SUFFIXES)
    if not paths:
        raise ContractError(f"{folder} holds no pictures ({', '.join(PICTURE_SUFFIXES)})")
    return tuple(paths[:count])


def crop_origin(
    size_px: tuple[int, int],
    sensor_size_px: tuple[int, int],
    share: float,
    quadrant: tuple[int, int],
) -> tuple[int, int]:
    """Return the even (x, y) of a crop on the way from the middle of the sensor to a corner.

    Args:
        size_px: (width, height) of the crop.
        sensor_size_px: (width, height) of the sensor.
        share: 0 centred, 1 touching the corner.
        quadrant: Sign of (x, y) of the corner.

    Raises:
        ContractError: If the crop is larger than the sensor.
    """
    if any(c > s for c, s in zip(size_px, sensor_size_px, strict=True)):
        raise ContractError(f"a picture of {size_px} px does not fit a sensor of {sensor_size_px}")
    origin = []
    for start, side, whole, sign in zip(
        centred_origin(size_px, sensor_size_px), size_px, sensor_size_px, quadrant, strict=True
    ):
        end = (whole - side) // 2 * 2 if sign > 0 else 0
        origin.append(round((start + share * (end - start)) / 2) * 2)
    return origin[0], origin[1]


def expose(
    shot: Shot,
    scene: FloatArray,
    bundle: Bundle,
    lens: FrozenOptics,
    *,
    depth_mm: float | None = None,
) -> Exposed:
    """Photograph a picture.

    Args:
        shot: Place, ISO and noise.
        scene: (3, h, w) float32 linear Rec.709, as fine as the pictures of the bundle.
        bundle: The camera; its optics are what methods may know.
        lens: What the light really goes through.
        depth_mm: Object distance, which `lens` knows; None for the bundle's reference depth.
    """
    sensor, scale = light_sensor(bundle.manifest), picture_scale(bundle.manifest)
    quadrant = QUADRANTS[shot.number % len(QUADRANTS)]
    size = (scene.shape[2] // scale, scene.shape[1] // scale)
    whole = (sensor.width_px, sensor.height_px)
    options = SimulationOptions(
        iso=shot.iso,
        seed=shot.noise_seed,
        origin_px=crop_origin(size, whole, FIELD_SHARES[shot.position], quadrant),
        scale=scale,
        depth_mm=bundle.reference_depth_mm if depth_mm is None else depth_mm,
    )
    simulation = simulate(scene, sensor, lens.psf, options, haze=lens.haze)
    sharp = encode_srgb(true_picture(simulation.clean, sensor))
    return Exposed(simulation=simulation, truths={IMAGE: sharp})


def read_picture(path: Path, most_px: int | None = None) -> FloatArray:
    """Read a picture as linear Rec.709, greys replicated; its middle if a side exceeds a limit.

    Raises:
        DecodeError: If it is damaged, no picture, not finite or darker than black; names the file.
    """
    scene = read_light(path)
    if scene.min() < 0:
        raise DecodeError(f"{path}: samples down to {scene.min():g}; a scene must be >= 0")
    if most_px is not None:
        _, height, width = scene.shape
        top, left = (max(side - most_px, 0) // 2 for side in (height, width))
        scene = scene[:, top : top + most_px, left : left + most_px]
    return np.ascontiguousarray(scene)


def judge(restored: FloatArray, sharp: FloatArray) -> Score:
    """Compare a restoration with the sharp picture.

    Args:
        restored: (3, h, w) float32 linear Rec.709.
        sharp: (3, h, w) float32 sRGB values.

    References: Wang et al. 2004 (SSIM with Gaussian weights of sigma 1.5).
    """
    truth, got = inner_srgb(restored, sharp)
    ssim = structural_similarity(
        truth,
        got,
        data_range=1.0,
        channel_axis=-1,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
    )
    return Score(psnr_db=psnr(truth, got), ssim=float(ssim))


def inner_srgb(restored: FloatArray, sharp: FloatArray) -> tuple[FloatGrid, FloatGrid]:
    """Return truth and restoration as (h, w, 3) sRGB values without the border."""
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    truth = sharp[inside].transpose(1, 2, 0).astype(np.float64)
    return truth, encode_srgb(restored[inside]).transpose(1, 2, 0).astype(np.float64)


def psnr(truth: FloatGrid, got: FloatGrid) -> float:
    """Return the PSNR in dB of values up to 1."""
    # equal pictures would be infinitely good, which no mean survives
    if (truth == got).all():
        return 120.0
    return float(peak_signal_noise_ratio(truth, got, data_range=1.0))
