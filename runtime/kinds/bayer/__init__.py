"""Photographs: behind a mosaic, or of full planes of colour or of grey."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.kind import RuntimePart
from camkit.runtime.options import Options
from camkit.runtime.raw import read_capture
from camkit.runtime.signal.halves import mean_of_halves, right_half

if TYPE_CHECKING:
    from camkit.runtime.twin.simulate import Simulation


def read(
    file: Path, mosaic: MosaicOptions | None, manifest: Manifest | None, options: Options
) -> Capture:
    """Read RAW, DNG, EXR, TIFF, PNG or JPEG; of dual pixels the mean of both halves."""
    is_grey = manifest is not None and len(manifest.sensor.channels) == 1
    read_one = partial(read_capture, mosaic=mosaic, tone=options.tone, is_grey=is_grey)
    if options.halves is None:
        return read_one(file)
    other = right_half(file, options.halves)
    return mean_of_halves(read_one(file), read_one(other), (file.name, other.name))


def write(path: Path, simulation: "Simulation", bundle: Bundle) -> None:
    """Write a DNG that names its bundle."""
    # imported late: reading needs no twin
    from camkit.runtime.twin.simulate import write_capture

    manifest = bundle.manifest
    write_capture(path, simulation, manifest.sensor, manifest.name, bundle.psf_sha256)


PART: Final = RuntimePart(read=read, write=write, suffixes=(".dng",))
