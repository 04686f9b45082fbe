"""The facts that a photograph states of itself, for `camkit info`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from camkit.bundle.reader import built_in_bundles, open_bundle
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files.doubts import notes_behind
from camkit.runtime.raw import read_capture


def describe_photograph(path: Path, mosaic: MosaicOptions | None) -> Mapping[str, Any]:
    """Return what a capture is, as plain JSON values.

    Raises:
        DecodeError: If it cannot be read.
    """
    capture = read_capture(path, mosaic=mosaic)
    matrix = capture.color_matrix
    noise = capture.noise
    return {
        "contract": capture.contract,
        "camera": capture.camera,
        "width": capture.width,
        "height": capture.height,
        "cfa": capture.cfa,
        "black_level": capture.black_level.ravel().tolist(),
        "white_level": capture.white_level,
        "white_balance": capture.white_balance,
        "color_matrix": None if matrix is None else matrix.round(4).tolist(),
        "orientation": capture.orientation,
        "iso": capture.iso,
        "exposure_time_s": capture.exposure_time_s,
        "metadata": capture.metadata.stated(),
        "noise": None if noise is None else [noise.shot, noise.read_variance],
        "origin_px": capture.origin_px,
        "sensor_size_px": capture.sensor_size_px,
        "pixel_pitch_um": capture.pixel_pitch_um,
        "bundle_named": capture.bundle_name,
        "notes": _notes(capture),
    }


def _notes(capture: Capture) -> list[str]:
    """Return the notes of a capture, those aside that the optics it names explain."""
    path = built_in_bundles().get(capture.bundle_name or "")
    if path is not None and capture.notes:
        bundle = open_bundle(path)
        if bundle.manifest.has_haze:
            return notes_behind(capture, bundle.haze)
    return list(capture.notes)
