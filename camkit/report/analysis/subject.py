"""Subjects of an analysis, by name: a bundle, a frozen PSF, a lens, a pinhole.

NAME            a bundle that comes with camkit, else a lens that does
FILE.camkit     a bundle
FILE.toml|.zmx  a lens
PSF.safetensors[+HAZE.safetensors]   frozen optics
lens:NAME       a lens, where a bundle has the same name
pinhole-D[@F]   a hole of D mm, F mm (43) before the sensor
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib import util
from pathlib import Path
from typing import Final

import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics, read_optics_file
from camkit.bundle.haze_file import read_haze
from camkit.bundle.reader import (
    PRESCRIPTION,
    SUFFIX,
    Bundle,
    built_in_bundles,
    find_bundle,
    missing_bundles,
    open_bundle,
)
from camkit.bundle.sensor import BayerSensor, ColorSensor
from camkit.entry_points import install_text
from camkit.errors import ContractError, UnsupportedError
from camkit.radial import RadialDistortion
from camkit.report.analysis.frozen_image import frozen_images, sensor_heights_mm
from camkit.report.analysis.physical import write_camera
from camkit.report.analysis.point_image import Band, PointImage
from camkit.report.kind_finder import check_photographs
from camkit.runtime.geometry.distortion import reference_channel, undistort_points
from camkit.runtime.twin.truth import light_sensor

USUAL_SENSOR: Final = "duet"
"""Bundle whose sensor stands behind what has none."""
LENS: Final = "lens:"
LENS_SUFFIXES: Final = (".toml", ".zmx", ".json")
PSF_SUFFIX: Final = ".safetensors"
HAZE_JOINT: Final = re.compile(r"(?<=\.safetensors)\+", re.IGNORECASE)
"""Between the two files of optics with a haze; a + elsewhere belongs to a name."""
PINHOLE: Final = re.compile(r"pinhole-(?P<diameter>[0-9.]+)(?:@(?P<distance>[0-9.]+))?")
PINHOLE_MM: Final = 43.0
"""Distance from hole to sensor: the focal length of the thin plate."""
Images = Callable[[Band, int], list[PointImage]]
Camera = Callable[[Path], Bundle]


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """Subject of an analysis.

    Attributes:
        name: As it was asked for.
        kind: `bundle`, `frozen`, `lens` or `pinhole`.
        sensor: Behind it.
        images: Gives the images of so many points in a colour.
        camera: Gives the camera that photographs and restores; may write into a folder, and take
            long.
    """

    name: str
    kind: str
    sensor: ColorSensor
    images: Images
    camera: Camera


def find_subject(name: str, like: ColorSensor | None = None) -> Subject:
    """Find what is to be analysed.

    Args:
        name: See above.
        like: The sensor behind what has none; None for that of `USUAL_SENSOR`.

    Raises:
        ContractError: If there is nothing of that name.
        BundleError: If a bundle or a frozen PSF is missing or damaged.
        UnsupportedError: If a bundle counts photons, or a lens needs torch and there is none.
    """
    # a lens of the same name must not stand for a bundle that is not installed
    is_bundle = name in {*built_in_bundles(), *missing_bundles()}
    if is_bundle or name.lower().endswith(SUFFIX):
        return _of_bundle(name)
    sensor = usual_sensor() if like is None else like
    if name.lower().endswith(PSF_SUFFIX):
        return _of_files(name, sensor)
    if util.find_spec("torch") is None:
        raise UnsupportedError(
            f"{name} is no bundle and no frozen optics; lenses and pinholes are traced, which "
            f"needs torch: {install_text('train')}"
        )
    hole = PINHOLE.fullmatch(name)
    return _of_lens(name, sensor) if hole is None else _of_hole(name, hole, sensor)


def usual_sensor() -> ColorSensor:
    """Return the sensor behind what has none."""
    return light_sensor(open_bundle(find_bundle(USUAL_SENSOR)).manifest)


def _of_bundle(name: str) -> Subject:
    bundle = open_bundle(find_bundle(name))
    check_photographs(bundle.manifest, "give a bundle with optics")
    sensor = light_sensor(bundle.manifest)
    haze = bundle.haze if bundle.manifest.has_haze else None
    optics = FrozenOptics(psf=bundle.psf, haze=haze)
    efl_mm = _efl_mm(bundle)

    def angle_at(height_mm: float) -> float | None:
        return None if efl_mm is None else ideal_angle_rad(optics.psf.distortion, height_mm, efl_mm)

    return Subject(
        name=name,
        kind="bundle",
        sensor=sensor,
        images=_frozen(optics, sensor, bundle.reference_depth_mm, angle_at),
        camera=lambda _: bundle,
    )


def _of_files(name: str, sensor: ColorSensor) -> Subject:
    psf, *haze = HAZE_JOINT.split(name)
    if len(haze) > 1:
        raise ContractError(f"frozen optics are PSF.safetensors[+HAZE.safetensors]; got {name}")
    read = read_optics_file(Path(psf), channels=len(sensor.channels))
    optics = FrozenOptics(psf=read.psf, haze=read_haze(Path(haze[0])) if haze else None)
    pitch_um = sensor.known_extent.pixel_pitch_um
    if not math.isclose(optics.psf.pixel_pitch_um, pitch_um, rel_tol=1e-6):
        raise ContractError(
            f"{psf} is of pixels of {optics.psf.pixel_pitch_um:g} um, the sensor's have "
            f"{pitch_um:g} um; put it into a bundle with its own sensor"
        )
    return Subject(
        name=name,
        kind="frozen",
        sensor=sensor,
        images=_frozen(optics, sensor, float(optics.psf.depths_mm[-1]), lambda _: None),
        camera=lambda folder: write_camera(
            folder / "frozen.camkit", "frozen", optics, _mosaic(sensor)
        ),
    )


def _frozen(
    optics: FrozenOptics,
    sensor: ColorSensor,
    depth_mm: float,
    angle_at: Callable[[float], float | None],
) -> Images:
    return lambda band, fields: frozen_images(
        optics, band, sensor_heights_mm(sensor, fields), depth_mm=depth_mm, angle_at=angle_at
    )


def _of_lens(name: str, sensor: ColorSensor) -> Subject:
    from camkit.models_def.optics.lens_file.lens_file import built_in_lenses, read_lens
    from camkit.report.analysis.traced_image import traced_images

    lens_name = name.removeprefix(LENS)
    if lens_name not in built_in_lenses() and Path(lens_name).suffix.lower() not in LENS_SUFFIXES:
        raise ContractError(
            f"nothing is called {name!r}: give a bundle ({', '.join(built_in_bundles())} or a "
            f"file), a lens ({', '.join(built_in_lenses())} or a file), frozen optics "
            "(PSF.safetensors+HAZE.safetensors) or pinhole-0.8"
        )
    lens = read_lens(Path(lens_name))

    def camera(folder: Path) -> Bundle:
        from camkit.report.analysis.frozen_lens import freeze_lens

        frozen = freeze_lens(lens, sensor)
        return write_camera(
            folder / "lens.camkit", _manifest_name(lens_name), frozen, _mosaic(sensor)
        )

    return Subject(
        name=name,
        kind="lens",
        sensor=sensor,
        images=lambda band, fields: traced_images(lens, sensor, band, fields),
        camera=camera,
    )


def _of_hole(name: str, match: re.Match[str], sensor: ColorSensor) -> Subject:
    from camkit.models_def.optics.diffraction.pinhole import Pinhole
    from camkit.report.analysis.frozen_lens import freeze_hole

    try:
        diameter_mm = float(match["diameter"])
        distance_mm = PINHOLE_MM if match["distance"] is None else float(match["distance"])
    except ValueError:
        raise ContractError(
            f"a pinhole is pinhole-DIAMETER or pinhole-DIAMETER@DISTANCE in mm; got {name}"
        ) from None
    hole = Pinhole(diameter_mm=diameter_mm, distance_mm=distance_mm)
    cache: list[FrozenOptics] = []

    def optics() -> FrozenOptics:
        if not cache:
            cache.append(freeze_hole(hole, sensor))
        return cache[0]

    def images(band: Band, fields: int) -> list[PointImage]:
        return frozen_images(
            optics(),
            band,
            sensor_heights_mm(sensor, fields),
            angle_at=lambda height_mm: math.atan(height_mm / distance_mm),
        )

    return Subject(
        name=name,
        kind="pinhole",
        sensor=sensor,
        images=images,
        camera=lambda folder: write_camera(
            folder / "pinhole.camkit", "pinhole", optics(), _mosaic(sensor)
        ),
    )


def _mosaic(sensor: ColorSensor) -> ColorSensor:
    if not isinstance(sensor, BayerSensor):
        raise UnsupportedError("optics without a bundle are photographed with a Bayer sensor only")
    return sensor


def _manifest_name(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", Path(name).stem.lower()).strip("-") or "lens"


def _efl_mm(bundle: Bundle) -> float | None:
    """Return the focal length of the lens that a bundle carries; None without one, or torch."""
    if bundle.configuration:
        return bundle.frozen_optics.lens_state.efl_mm
    if PRESCRIPTION not in bundle.names or util.find_spec("torch") is None:
        return None
    from camkit.models_def.optics.paraxial import paraxial_data
    from camkit.models_def.optics.prescription import parse_prescription

    return paraxial_data(parse_prescription(bundle.member(PRESCRIPTION).decode())).efl_mm


def ideal_angle_rad(distortion: RadialDistortion, height_mm: float, efl_mm: float) -> float:
    """Return the field angle whose light comes to a height, by the distortion of a lens.

    Args:
        distortion: As its frozen PSF has it.
        height_mm: From the axis.
        efl_mm: Its focal length.
    """
    ideal = undistort_points(
        np.array([0.0, height_mm]), distortion, channel=reference_channel(distortion)
    )
    return math.atan(float(ideal[1]) / efl_mm)
