"""Golden cases of a camera as files that any reader takes, and what the Python reader makes."""

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.golden import golden_from_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import GOLDEN, Bundle, find_bundle, open_bundle
from camkit.bundle.sensor import BayerSensor
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import DngTags, camkit_description, write_bayer_dng
from camkit.runtime.portable.package import write_portable
from camkit.runtime.raw import read_capture
from tools.portable_table import load_example

ROOT: Final = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class PortableCase:
    """A golden case.

    Attributes:
        photo: A DNG of its capture.
        light: What examples/python makes of it.
        output: What the bundle holds of it; None where camkit's own rules are others.
        allowed: Largest difference to that.
    """

    photo: Path
    light: FloatArray
    output: FloatArray | None
    allowed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PortableCamera:
    """A camera as files, its golden cases by name, and the reader of examples/python."""

    folder: Path
    archive: Path
    cases: dict[str, PortableCase]
    reader: Any

    def develop(self, photo: Path) -> FloatArray:
        """Return (3, h, w) light, as the reader in Python makes it."""
        capture = read_capture(photo, isolate=False)
        facts = capture.iso, capture.white_balance, capture.origin_px
        return np.asarray(self.reader.develop(np.asarray(capture.samples), *facts))


def make_camera(name: str, size: str, folder: Path) -> PortableCamera:
    """Write a camera of a bundle, and its golden cases, into a folder."""
    bundle = open_bundle(find_bundle(name))
    graphs, archive = folder / "camera", folder / "camera.zip"
    write_portable(bundle, graphs, (size,))
    with zipfile.ZipFile(archive, "w") as zipped:
        for path in sorted(graphs.iterdir()):
            zipped.write(path, path.name)
    reader = python_reader(graphs, size)
    cases = {
        case.name: _case(bundle, case, size, reader, folder) for case in bundle.manifest.golden
    }
    return PortableCamera(folder=graphs, archive=archive, cases=cases, reader=reader)


def write_photo(
    path: Path,
    bundle: Bundle,
    samples: NDArray[np.uint16],
    iso: float,
    white_balance: tuple[float, float, float] | None,
    origin_px: tuple[int, int],
    **levels: Any,
) -> None:
    """Write a capture of a bundle's camera as a DNG that leaves its noise to its ISO.

    Levels are `black` and `white`, where they are not those of the sensor.
    """
    sensor = bundle.manifest.sensor
    assert isinstance(sensor, BayerSensor)
    red, green, blue = white_balance or (1.0, 1.0, 1.0)
    extent = sensor.known_extent
    tags = DngTags(
        cfa=sensor.cfa,
        **{"black": round(sensor.black_level), "white": round(sensor.white_level)} | levels,
        color_matrix=np.array(sensor.color_matrix),
        as_shot_neutral=(1 / red, 1 / green, 1 / blue),
        camera_model=f"camkit {bundle.manifest.name}",
        metadata=Metadata(iso=iso),
        description=camkit_description(
            bundle=bundle.manifest.name,
            origin_px=origin_px,
            sensor_size_px=(extent.width_px, extent.height_px),
            pixel_pitch_um=extent.pixel_pitch_um,
        ),
    )
    write_bayer_dng(path, samples, tags=tags)


def _case(bundle: Bundle, case: GoldenCase, size: str, reader: Any, folder: Path) -> PortableCase:
    arrays = golden_from_bytes(bundle.member(GOLDEN))[case.name]
    photo = folder / f"{case.name}.dng"
    write_photo(photo, bundle, arrays.capture, case.iso, case.white_balance, case.origin_px)
    # gains as the file holds them: millionths
    gains = read_capture(photo, isolate=False).white_balance
    light = reader.develop(arrays.capture, case.iso, gains, case.origin_px)
    follows = all(reader.facts["agrees"].values())
    output = arrays.output("image", size) if follows else None
    most = 1.0 if output is None else max(1.0, float(np.abs(output).max()))
    allowed = case.atol + case.rtol * most
    return PortableCase(photo=photo, light=light, output=output, allowed=allowed)


def python_reader(folder: Path, size: str) -> Any:
    """Return the reader of examples/python on a written camera."""
    return load_example("portable_camera").PortableCamera(folder, size)


def difference_db(light: FloatArray, other: FloatArray) -> float:
    """Return the PSNR of one picture to another; the peak is white, or the brightest light."""
    error = np.mean((light.astype(np.float64) - other) ** 2)
    peak = max(1.0, float(np.abs(other).max()))
    return float(10 * np.log10(peak**2 / max(error, 1e-30)))
