"""Colour photographs behind a mosaic."""

from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.runtime.array_capture import capture_of_array
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.kind import Gains, RuntimePart
from camkit.runtime.raw import read_capture
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, simulate, write_capture


def read(file: Path, mosaic: MosaicOptions | None, _manifest: Manifest | None) -> Capture:
    """Read RAW, DNG, EXR, TIFF or PNG."""
    return read_capture(file, mosaic=mosaic)


def from_array(
    image: NDArray[Any],
    manifest: Manifest,
    iso: float | None,
    white_balance: Gains | None,
    origin_px: tuple[int, int] | None,
) -> Capture:
    """Take an array for a capture of the bundle's sensor."""
    return capture_of_array(
        image, manifest, iso=iso, white_balance=white_balance, origin_px=origin_px
    )


def photograph(scene: FloatArray, bundle: Bundle, options: SimulationOptions) -> Simulation:
    """Photograph a scene with the bundle's camera."""
    return simulate(scene, bundle.manifest.sensor, bundle.psf, options)


def write(path: Path, simulation: Simulation, bundle: Bundle) -> None:
    """Write a DNG that names its bundle."""
    write_capture(path, simulation, bundle.manifest.sensor, bundle.manifest.name)


PART: Final = RuntimePart(
    read=read, from_array=from_array, simulate=photograph, write=write, suffix=".dng"
)
