"""A capture without its samples as plain JSON, as the decoding child sends it, and back."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.noise import NoiseModel
from camkit.runtime.capture import Capture
from camkit.runtime.metadata import Metadata


def header_of(capture: Capture) -> dict[str, Any]:
    """Return everything but the samples as plain JSON values."""
    header: dict[str, Any] = {
        f.name: getattr(capture, f.name) for f in fields(capture) if f.name != "samples"
    }
    header["black_level"] = capture.black_level.tolist()
    if capture.color_matrix is not None:
        header["color_matrix"] = capture.color_matrix.tolist()
    if capture.noise is not None:
        header["noise"] = [capture.noise.shot, capture.noise.read_variance]
    header["metadata"] = asdict(capture.metadata)
    header["dtype"] = capture.samples.dtype.name
    header["shape"] = capture.samples.shape
    header["planes_sent"] = 1 if is_repeated(capture.samples) else None
    return header


def capture_of(header: dict[str, Any], samples: NDArray[Any]) -> Capture:
    """Rebuild a capture from `header_of` and its samples.

    Raises:
        ContractError, KeyError, TypeError, ValueError: If the header is not of `header_of`.
    """
    values = {f.name: header[f.name] for f in fields(Capture) if f.name != "samples"}
    values["black_level"] = np.array(values["black_level"], dtype=np.float32)
    for name in ("white_balance", "origin_px", "sensor_size_px", "notes"):
        values[name] = None if values[name] is None else tuple(values[name])
    if values["color_matrix"] is not None:
        values["color_matrix"] = np.array(values["color_matrix"], dtype=np.float64)
    if values["noise"] is not None:
        shot, read_variance = (tuple(part) for part in values["noise"])
        values["noise"] = NoiseModel(shot=shot, read_variance=read_variance)
    values["metadata"] = Metadata(**values["metadata"])
    return Capture(samples=samples, **values)


def is_repeated(samples: NDArray[Any]) -> bool:
    """Return whether samples are one plane seen several times."""
    return samples.ndim == 3 and samples.strides[0] == 0
