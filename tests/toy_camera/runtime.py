"""The toy camera at use time: a 16-bit TIFF whose description says what the numbers are, the twin.

file.tif    (h, w) DN; ImageDescription: {"toy": {bundle, iso, black, white, origin_px, ...}}
"""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import tifffile
from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.errors import ContractError, DecodeError
from camkit.runtime.array_capture import capture_of_array
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.kind import Gains, RuntimePart
from camkit.runtime.output.part_file import atomic_output
from camkit.runtime.raw import file_sha256
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, simulate
from camkit.runtime.twin.truth import light_sensor

NAME: Final = "toy"


def read(file: Path, mosaic: MosaicOptions | None, _manifest: Manifest | None) -> Capture:
    """Read a file of the toy camera."""
    if mosaic is not None:
        raise ContractError("the toy camera has no mosaic; leave --mosaic out")
    try:
        with tifffile.TiffFile(file) as tiff:
            samples, text = tiff.asarray(), tiff.pages[0].description  # type: ignore[union-attr]
        said: dict[str, Any] = json.loads(text)[NAME]
    except (OSError, ValueError, KeyError, TypeError, tifffile.TiffFileError) as error:
        raise DecodeError(f"{file.name} is no capture of the toy camera: {error}") from error
    return Capture(
        samples=samples[None],
        cfa=None,
        black_level=np.array([said["black"]], np.float32),
        white_level=said["white"],
        iso=said["iso"],
        origin_px=tuple(said["origin_px"]),
        sensor_size_px=tuple(said["sensor_size_px"]),
        bundle_name=said["bundle"],
        camera="toy",
        sha256=file_sha256(file),
    )


def from_array(
    image: NDArray[Any],
    manifest: Manifest,
    iso: float | None,
    white_balance: Gains | None,
    origin_px: tuple[int, int] | None,
) -> Capture:
    """Take (1, h, w) for a capture."""
    return capture_of_array(
        image, manifest, iso=iso, white_balance=white_balance, origin_px=origin_px
    )


def photograph(scene: FloatArray, bundle: Bundle, options: SimulationOptions) -> Simulation:
    """Photograph a scene through the streaks."""
    return simulate(scene, bundle.manifest.sensor, bundle.psf, options)


def write(path: Path, simulation: Simulation, bundle: Bundle) -> None:
    """Write what `read` reads."""
    sensor, window = light_sensor(bundle.manifest), simulation.window
    said = {
        "bundle": bundle.manifest.name,
        "iso": simulation.iso,
        "black": sensor.black_level,
        "white": sensor.white_level,
        "origin_px": [int(v) for v in window.origin_px],
        "sensor_size_px": list(window.sensor_size_px),
    }
    with atomic_output(path) as part:
        tifffile.imwrite(
            part,
            simulation.samples[0],
            photometric="minisblack",
            description=json.dumps({NAME: said}),
            metadata=None,
        )


PART: Final = RuntimePart(
    read=read, from_array=from_array, simulate=photograph, write=write, suffix=".tif"
)
