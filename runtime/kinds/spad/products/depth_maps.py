"""Depth and what goes with it, of histograms and gate scans."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.sensor import SpadSensor
from camkit.runtime.capture_result import Result
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture
from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.float_pictures import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.points import write_points
from camkit.runtime.kinds.spad.products.preview import depth_picture, write_preview
from camkit.runtime.kinds.spad.products.record import told_pulse, told_way, total_photons
from camkit.runtime.kinds.spad.pulse import FWHM_PER_SIGMA, GaussianPulse, Pulse
from camkit.runtime.kinds.spad.sharpen import Sharpened
from camkit.runtime.kinds.spad.stages.sharpen import Depths
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS

NAMED_HOT: Final = 10


def make_depth(work: Reconstruction, capture: PhotonCapture, product: str) -> Result:
    """Return depth, and what was found with it.

    Args:
        work: The capture on its way.
        capture: It.
        product: Name of its depth.

    Raises:
        DecodeError: If the file is damaged, or holds no counts.
        ContractError: If what is stated of it cannot be true of it.
        Cancelled: If the caller wished so.
    """
    stream = work.stream_of(product)
    for _ in work.metered(stream.bands()):
        pass
    depths = stream.facts
    assert isinstance(depths, Depths)
    assert depths.pulse is not None  # its rows were read
    sharpened, scale = depths.whole(), 1 if depths.bins is None else depths.bins.scale
    arrays = _arrays(sharpened, depths, capture, scale)
    hot = [[int(x), int(y)] for y, x in np.argwhere(sharpened.hot[0][::scale, ::scale])]
    layers = arrays["depth_m"].reshape(sharpened.valid.shape)
    intensity = arrays["intensity"].reshape(sharpened.valid.shape)
    lens = _lens(capture, scale)
    phase = _phase(work) if scale > 1 else 0
    guess = None if capture.timing.pulse() is not None else depths.pulse
    return Result(
        arrays=arrays,
        writers={
            ".npz": lambda path: write_archive(path, arrays),
            ".ply": lambda path: write_points(
                path, layers, intensity, **lens, scale=scale, phase=phase
            ),
            ".png": lambda path: write_preview(path, depth_picture(layers[0])),
        },
        pictures={
            "exr": (".exr", lambda path: write_exr(path, layers, "Z")),
            "tiff": (".tif", lambda path: write_tiff(path, layers)),
        },
        record={
            "product": "depth",
            **told_way(capture.settings.way),
            **_told_finer(depths),
            **told_pulse(depths.pulse, is_guessed=guess is not None),
            "templates": depths.templates,
        },
        seconds=work.seconds,
        warnings=(
            *_warnings(sharpened, depths, capture, guess, hot),
            *work.warnings,
            *capture.late_notes(),
        ),
        sections={"spad": _section(sharpened, depths, capture, hot)},
    )


def _phase(work: Reconstruction) -> int:
    sensor = work.job.known_bundle.manifest.sensor
    assert isinstance(sensor, SpadSensor)
    return sensor.phase


def _lens(capture: PhotonCapture, scale: int) -> dict[str, float]:
    """Return pitch and focal length of the pixels of depth.

    Where nothing is known of the lens, one whose focal length is the width of the array.
    """
    array = capture.timing.array
    if array.pitch_um is None or array.focal_length_mm is None:
        return {"pitch_um": 1.0 / scale, "focal_length_mm": capture.width * 1e-3}
    return {"pitch_um": array.pitch_um / scale, "focal_length_mm": array.focal_length_mm}


def _told_finer(depths: Depths) -> Mapping[str, Any]:
    bins = depths.bins
    if bins is None:
        return {}
    finer = "linear" if bins.size is None else "net"
    return {"finer": finer, "size": bins.size, "signal_photons": round(bins.photons, 2)}


def _arrays(
    sharpened: Sharpened, depths: Depths, capture: PhotonCapture, scale: int
) -> dict[str, NDArray[Any]]:
    """Return the arrays of the archive; the leading axis goes where there is one return."""
    dark = depths.pixels.dark.repeat(scale, axis=0).repeat(scale, axis=1)
    depth = (sharpened.time_of_flight_ps - capture.timing.correction.offset_ps) * LIGHT_M_PER_PS / 2
    arrays: dict[str, NDArray[Any]] = {
        "depth_m": np.where(sharpened.valid, depth, np.nan),
        "time_of_flight_ps": sharpened.time_of_flight_ps,
        "amplitude": sharpened.amplitude.astype(np.float32),
        "background": np.maximum(sharpened.background - dark, 0.0).astype(np.float32),
        "sigma_ps": sharpened.sigma_ps.astype(np.float32),
        "evidence": sharpened.evidence.astype(np.float32),
        "intensity": (sharpened.intensity - dark * capture.bins).astype(np.float32),
        "valid": sharpened.valid,
        "pooled": sharpened.pooled.astype(np.uint8),
    }
    if capture.settings.way.returns == 1:
        return {name: values[0] for name, values in arrays.items()}
    return arrays


def _section(
    sharpened: Sharpened, depths: Depths, capture: PhotonCapture, hot: list[list[int]]
) -> Mapping[str, Any]:
    sides, counts = np.unique(sharpened.pooled[sharpened.valid], return_counts=True)
    return {
        "pixels": int(sharpened.hot[0].size),
        "valid": [int(layer.sum()) for layer in sharpened.valid],
        "hot": hot,
        "blind": int(depths.pixels.blind.sum()),
        "pile_up": round(float(depths.pixels.worst.max(initial=0.0)), 4),
        "pooled": {str(s): int(n) for s, n in zip(sides.tolist(), counts.tolist(), strict=True)},
        "photons": total_photons(sharpened.intensity[0], capture.shape),
    }


def _warnings(
    sharpened: Sharpened,
    depths: Depths,
    capture: PhotonCapture,
    guess: Pulse | None,
    hot: list[list[int]],
) -> list[str]:
    notes = []
    if isinstance(guess, GaussianPulse):
        notes.append(
            f"no pulse is stated: a Gaussian of {FWHM_PER_SIGMA * guess.sigma_ps:.3g} ps full "
            "width is estimated; state [laser] fwhm_ps, [gate] or [irf] if you know it"
        )
    if hot:
        places = ", ".join(f"({x}, {y})" for x, y in hot[:NAMED_HOT])
        more = f" and {len(hot) - NAMED_HOT} more" if len(hot) > NAMED_HOT else ""
        notes.append(
            f"hot pixels at {places}{more}: filled from their neighbours, marked not valid"
        )
    if depths.pixels.blind.any():
        notes.append(
            f"pile-up is too strong to correct in {int(depths.pixels.blind.sum())} pixels: they "
            "are marked not valid"
        )
    if not sharpened.valid.any():
        notes.append("no pixel has enough photons for a reliable distance")
    array = capture.timing.array
    if array.pitch_um is None or array.focal_length_mm is None:
        notes.append(
            "the lens is not stated: the point cloud assumes a focal length equal to the width of "
            "the array; state [array] pitch_um and focal_length_mm"
        )
    return notes
