"""Small DNGs for the decoder tests, written with the project's own writer."""

import struct
from typing import Any

import numpy as np
import tifffile

from camkit.noise import NoiseModel
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import DngTags, camkit_description, write_bayer_dng

MATRIX = np.array([[0.664, -0.1847, -0.0503], [-0.5238, 1.301, 0.2474], [-0.0993, 0.1673, 0.6527]])
NOISE = NoiseModel(shot=(1e-4, 2e-4, 3e-4), read_variance=(1e-7, 2e-7, 3e-7))


def dng_tags(**change):
    values = {
        "cfa": "RGGB",
        "black": 256,
        "white": 4095,
        "color_matrix": MATRIX,
        "as_shot_neutral": (0.5, 1.0, 0.625),
        "camera_model": "camkit duet",
        "metadata": Metadata(iso=400, exposure_time_s=1 / 50),
        "noise": NOISE,
        "description": camkit_description(
            bundle="duet", origin_px=(3, 4), sensor_size_px=(6000, 4000), pixel_pitch_um=5.96
        ),
    }
    return DngTags(**(values | change))


def grey_tags(**change: Any) -> DngTags:
    """Tags of a camera of 12 bits that sees every colour alike, and is known by nothing else."""
    values: dict[str, Any] = {
        "cfa": "RGGB",
        "black": 256,
        "white": 4095,
        "color_matrix": None,
        "as_shot_neutral": (1.0, 1.0, 1.0),
        "camera_model": "camkit test",
    }
    return DngTags(**(values | change))


def scene_mosaic(height=60, width=80, seed=1):
    """A gradient with noise: believable, every row different."""
    rng = np.random.default_rng(seed)
    ramp = np.linspace(300, 3500, height * width).reshape(height, width)
    return (ramp + rng.normal(0, 8, ramp.shape)).astype(np.uint16)


def write_scene(path, **change):
    mosaic = scene_mosaic()
    write_bayer_dng(path, mosaic, tags=dng_tags(**change))
    return mosaic


def write_monochrome(path, plane):
    """Write LinearRaw with one sample, which tifffile refuses to name so."""
    extra = [(50714, 4, 1, 64, True), (50717, 4, 1, 4095, True)]
    write_other(path, plane, 1, extra)
    data = path.read_bytes()
    blackiszero, linear_raw = (struct.pack("<HHIHH", 262, 3, 1, n, 0) for n in (1, 34892))
    assert data.count(blackiszero) == 1
    path.write_bytes(data.replace(blackiszero, linear_raw))


def write_other(path, samples, photometric, extra):
    """Write a DNG that the project itself does not make: one directory, with the tags `extra`."""
    common = [
        (271, 2, 0, "camkit", True),
        (272, 2, 0, "duet", True),
        (274, 3, 1, 1, True),
        (50706, 1, 4, bytes((1, 4, 0, 0)), True),
        (50708, 2, 0, "camkit duet", True),
        (50721, 10, 9, tuple(n for v in MATRIX.ravel() for n in (round(v * 10**6), 10**6)), True),
        (50728, 5, 3, (1, 2, 1, 1, 5, 8), True),
        (50778, 3, 1, 21, True),
        (33434, 5, 1, (1, 50), True),
        (34855, 3, 1, 400, True),
        (51041, 12, 6, (1e-4, 1e-7, 2e-4, 2e-7, 3e-4, 3e-7), True),
    ]
    tifffile.imwrite(
        path,
        samples,
        photometric=photometric,
        planarconfig="contig" if samples.ndim == 3 else None,
        subfiletype=0,
        metadata=None,
        software=False,
        extratags=[*extra, *common],
    )
