"""The camera at use time: its captures are 16-bit grey TIFFs, as it writes them or of the twin.

What a file says of itself, as those of the twin do, stands in its description as JSON.
"""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import tifffile

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.kind import RuntimePart
from camkit.runtime.options import Options
from camkit.runtime.output.part_file import atomic_output
from camkit.runtime.raw import file_sha256
from camkit.runtime.twin.simulate import Simulation
from camkit.runtime.twin.truth import light_sensor

NAME: Final = "lensless"


def read(
    file: Path, mosaic: MosaicOptions | None, manifest: Manifest | None, _options: Options
) -> Capture:
    """Read a capture; its levels are those of the bundle."""
    if mosaic is not None:
        raise ContractError("this camera has no mosaic; leave it out")
    if manifest is None:
        raise ContractError(f"a capture without a lens needs {option_text('bundle')}")
    try:
        with tifffile.TiffFile(file) as tiff:
            page = tiff.pages.first
            samples, text = page.asarray(), page.description
    except (OSError, ValueError, tifffile.TiffFileError) as error:
        raise DecodeError(f"{file.name} cannot be read: {error}") from error
    if samples.ndim != 2 or samples.dtype != np.uint16:
        raise DecodeError(
            f"{file.name} must be a grey TIFF of 16 bits; got {samples.dtype} {samples.shape}"
        )
    sensor, said = light_sensor(manifest), _said(text)
    return Capture(
        samples=samples[None],
        cfa=None,
        black_level=np.array([sensor.black_level], np.float32),
        white_level=sensor.white_level,
        iso=said.get("iso"),
        origin_px=said.get("origin_px") and tuple(said["origin_px"]),
        sensor_size_px=said.get("sensor_size_px") and tuple(said["sensor_size_px"]),
        bundle_name=said.get("bundle"),
        camera=NAME if said else "",
        sha256=file_sha256(file),
    )


def _said(text: str) -> dict[str, Any]:
    try:
        said = json.loads(text)[NAME]
    except (ValueError, KeyError, TypeError):
        return {}
    return said if isinstance(said, dict) else {}


def write(path: Path, simulation: Simulation, bundle: Bundle) -> None:
    """Write what `read` reads."""
    window = simulation.window
    said = {
        "bundle": bundle.manifest.name,
        "iso": simulation.iso,
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
