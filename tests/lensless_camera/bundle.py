"""A bundle of a lensless camera: what its maker writes from a photograph of a point light."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.golden import IMAGE, GoldenArrays, golden_to_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import ChannelResponse, Extent, IsoNoise, PlanesSensor
from camkit.bundle.stages import Color, Linearise
from camkit.bundle.writer import write_bundle, write_physics
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from camkit.runtime.twin.truth import ideal_picture
from camkit.scenes import procedural_scene
from tests.lensless_camera import KIND
from tests.lensless_camera.entry import LenslessAdmm

WAVELENGTH_UM: Final = 0.55
CASE: Final = GoldenCase(name="typical", iso=100, recipe={"seed": 3}, rtol=2e-3, atol=2e-3)
"""Rounds add up what different transforms of different machines round."""
GOLDEN_PX: Final = 64


def kernel_of(photograph_dn: NDArray[Any], black_dn: float) -> FloatArray:
    """Return the kernel that a photograph of a point light shows: odd sides, sum 1."""
    light = np.maximum(photograph_dn.astype(np.float32) - np.float32(black_dn), 0)
    odd = np.pad(light, [(0, 1 - side % 2) for side in light.shape])
    return np.asarray(odd / odd.sum(dtype=np.float64), dtype=np.float32)


def psf_of(kernel: FloatArray, pitch_um: float) -> FrozenPsf:
    """Return the optics of one kernel for the whole frame."""
    return FrozenPsf(
        kernels=kernel[None, None, None],
        field_heights_mm=np.zeros(1),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([WAVELENGTH_UM]),
        pixel_pitch_um=pitch_um,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0.0, 0.0, 0.0]]), radius_mm=1.0),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )


def sensor_of(
    size_px: tuple[int, int], pitch_um: float, levels: tuple[float, float]
) -> PlanesSensor:
    """Return a grey sensor of (h, w) pixels with black and white level; its noise is a guess."""
    height, width = size_px
    return PlanesSensor(
        extent=Extent(width_px=width, height_px=height, pixel_pitch_um=pitch_um),
        channels=("Y",),
        black_level=levels[0],
        white_level=levels[1],
        full_well_e=10_000,
        noise=(IsoNoise(iso=100, gain_e_per_dn=10_000 / levels[1], read_noise_e=5.0),),
        channel_response=ChannelResponse(
            wavelengths_um=(WAVELENGTH_UM,), response=((1.0,),), source="grey, not measured"
        ),
    )


def write_lensless(
    path: Path,
    kernel: FloatArray,
    sensor: PlanesSensor,
    *,
    proved: bool = True,
    **settings: Any,
) -> Bundle:
    """Write the bundle of a camera.

    Args:
        path: The .camkit file.
        kernel: See `kernel_of`.
        sensor: See `sensor_of`.
        proved: Whether it holds a golden case, which takes a trial of the stage.
        settings: Fields of its stage.
    """
    assert sensor.extent is not None
    optics = FrozenOptics(psf=psf_of(kernel, sensor.extent.pixel_pitch_um))
    stages = (Linearise(gives=("light",)), LenslessAdmm(**settings), Color(takes=("scene",)))
    made = write_physics(
        path, stages, sensor, optics, np.inf, kind=KIND.name, name=path.stem, version="1.0.0"
    )
    return _with_golden(made) if proved else made


def _with_golden(bare: Bundle) -> Bundle:
    """Write a bundle anew with a case that proves it."""
    sensor = bare.manifest.sensor
    assert sensor.extent is not None
    sides = (min(GOLDEN_PX, side) for side in (sensor.extent.height_px, sensor.extent.width_px))
    case = CASE.model_copy(update={"origin_px": (0, 0)})
    scene = procedural_scene(3, *sides)
    taken = photograph(scene, bare, SimulationOptions(iso=case.iso, seed=3, origin_px=(0, 0)))
    truth = GoldenArrays(capture=taken.samples, reference=ideal_picture(taken, bare), outputs={})
    made = case_work(bare, case, truth, None).fill()
    golden = replace(truth, outputs={IMAGE: {"none": made}})
    members = {name: bare.member(name) for name in bare.names}
    members["golden.safetensors"] = golden_to_bytes({case.name: golden})
    write_bundle(bare.path, bare.manifest.model_copy(update={"golden": (case,)}), members)
    return open_bundle(bare.path)
