"""The toy camera at use time: a 16-bit TIFF whose description says what the numbers are, the twin.

file.tif    (h, w) DN; ImageDescription: {"toy": {bundle, iso, black, white, origin_px, ...}}
"""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import tifffile

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.kind import RuntimePart
from camkit.runtime.options import Options
from camkit.runtime.output.part_file import atomic_output
from camkit.runtime.raw import file_sha256
from camkit.runtime.twin.simulate import Simulation
from camkit.runtime.twin.truth import light_sensor

NAME: Final = "toy"


def read(
    file: Path, mosaic: MosaicOptions | None, _manifest: Manifest | None, _options: Options
) -> Capture:
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


PART: Final = RuntimePart(read=read, write=write, suffixes=(".tif",))
