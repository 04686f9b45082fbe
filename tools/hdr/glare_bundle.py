"""Build the bundle that removes glare: `python -m tools.hdr.glare_bundle -o deglare.camkit`.

It holds physics alone: no optics, no network, pictures of any size. Its golden cases are a night
scene with streaks as a mosaic and as linear planes. `--angles LOW HIGH` builds one for
streaks of other angles from the vertical.
"""

import argparse
import math
import tempfile
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE, NO_SIZE, GoldenArrays, golden_to_bytes
from camkit.bundle.manifest import GoldenCase, Manifest, manifest_without_networks
from camkit.bundle.reader import CARD, GOLDEN
from camkit.bundle.sensor import BayerSensor, IsoNoise
from camkit.bundle.stages import (
    Color,
    Deglare,
    Demosaic,
    Linearise,
    RaiseClipped,
    Stage,
    WhiteBalance,
)
from camkit.bundle.writer import write_bundle
from camkit.cfa import cfa_channels
from camkit.colorimetry import D65, REC709_PRIMARIES, rgb_to_xyz
from camkit.export.proving import write_proved
from camkit.runtime.proof.golden_run import case_work
from tools.hdr.glare_twin import exposed_scene, photographed, two_point_star

NAME: Final = "deglare"
VERSION: Final = "0.1.0"
BLACK: Final = 256
WHITE: Final = 4095
SIDE_PX: Final = (192, 256)
"""(rows, columns) of a golden case."""
ANGLE_DEG: Final = -5.0
SCENE: Final = "night:6"
CASES: Final = ("streaks", "planes")
CARD_TEXT: Final = """# deglare

Takes away the two opposite streaks that a wiped windshield writes through every light. Physics
alone: the angle, the fading and every streak are estimated from the picture. No training data.

It fails on streaks of several angles, on fans that widen, on streaks that clip themselves, and
leaves a picture as it is where it is not sure.
"""


def main() -> None:
    """Build the bundle and say its size."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--angles", nargs=2, type=float, default=(2.5, 8.0), metavar="DEG")
    arguments = parser.parse_args()
    low, high = arguments.angles
    stage = Deglare(takes=("rgb",), least_angle_deg=low, most_angle_deg=high)
    print(f"{build(arguments.output, stage)} bytes")


def build(out: Path, deglare: Deglare) -> int:
    """Write a bundle that proved itself; give its bytes.

    Raises:
        ParityError: If it fails its own check; nothing is written then.
    """
    manifest = _manifest(deglare)
    cases = {name: _case(name) for name in CASES}
    with tempfile.TemporaryDirectory() as folder:
        bare = write_bundle(Path(folder) / "bare.camkit", manifest, {})
        arrays = {}
        for name, (case, arrays_of_case) in cases.items():
            picture = case_work(bare, case, arrays_of_case, None).fill()
            outputs = {IMAGE: {NO_SIZE: picture}}
            arrays[name] = GoldenArrays(
                capture=arrays_of_case.capture, reference=arrays_of_case.reference, outputs=outputs
            )
        members = {GOLDEN: golden_to_bytes(arrays), CARD: CARD_TEXT.encode()}
        golden = tuple(case for case, _ in cases.values())
        manifest = manifest.model_copy(update={"golden": golden})
    write_proved(out, manifest, members)
    return out.stat().st_size


def _manifest(deglare: Deglare) -> Manifest:
    sensor = BayerSensor(
        cfa="RGGB",
        black_level=BLACK,
        white_level=WHITE,
        full_well_e=10_000,
        noise=(IsoNoise(iso=100, gain_e_per_dn=2.5, read_noise_e=5.0),),
        color_matrix=_rows(np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65))),
    )
    # nothing is repaired: a lamp of one pixel is a light, and lights stay
    stages: tuple[Stage, ...] = (
        Linearise(gives=("light",)),
        WhiteBalance(takes=("light",)),
        Demosaic(),
        deglare,
        RaiseClipped(takes=deglare.gives),
        Color(takes=("neutral",)),
    )
    return manifest_without_networks(
        stages,
        sensor,
        None,
        name=NAME,
        version=VERSION,
        licence="Apache-2.0",
        exported_with={name: metadata.version(name) for name in ("camkit", "numpy", "scipy")},
    )


def _rows(matrix: NDArray[np.floating]) -> Any:
    return tuple(tuple(float(value) for value in row) for row in matrix)


def _case(name: str) -> tuple[GoldenCase, GoldenArrays]:
    """Photograph a golden case, its output still to be added."""
    star = two_point_star(math.radians(ANGLE_DEG))
    shot = photographed(exposed_scene(SCENE, *SIDE_PX), star)
    case = GoldenCase(
        name=name,
        recipe={"scene": SCENE, "angle_deg": ANGLE_DEG},
        iso=100,
        white_balance=(1.0, 1.0, 1.0),
    )
    capture = shot.picture if name == "planes" else mosaic_of(shot.picture)
    return case, GoldenArrays(capture=capture, reference=shot.truth)


def mosaic_of(planes: FloatArray) -> NDArray[np.uint16]:
    """Return the mosaic (h, w) that the sensor of the bundle sees of planes (3, h, w)."""
    light = np.empty(planes.shape[1:], np.float32)
    for row, colours in enumerate(cfa_channels("RGGB")):
        for column, colour in enumerate(colours):
            light[row::2, column::2] = planes[colour, row::2, column::2]
    return np.round(BLACK + light * (WHITE - BLACK)).astype(np.uint16)


if __name__ == "__main__":
    main()
