"""Colour photographs behind a mosaic."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.kind import RuntimePart
from camkit.runtime.options import Options
from camkit.runtime.raw import read_capture

if TYPE_CHECKING:
    from camkit.runtime.twin.simulate import Simulation


def read(
    file: Path, mosaic: MosaicOptions | None, _manifest: Manifest | None, _options: Options
) -> Capture:
    """Read RAW, DNG, EXR, TIFF or PNG."""
    return read_capture(file, mosaic=mosaic)


def write(path: Path, simulation: "Simulation", bundle: Bundle) -> None:
    """Write a DNG that names its bundle."""
    # imported late: reading needs no twin
    from camkit.runtime.twin.simulate import write_capture

    write_capture(path, simulation, bundle.manifest.sensor, bundle.manifest.name)


PART: Final = RuntimePart(read=read, write=write, suffixes=(".dng",))
