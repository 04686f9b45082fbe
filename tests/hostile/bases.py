"""The sound bundles from which hostile ones are made: manifest as JSON, members as bytes."""

import io
import json
import tempfile
import zipfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from camkit.bundle.golden import NO_SIZE, GoldenArrays, golden_from_bytes, golden_to_bytes
from camkit.bundle.reader import GOLDEN, MANIFEST, Bundle, bundle_from_bytes
from camkit.bundle.stages import Color, Linearise, Wiener
from camkit.bundle.writer import bundle_to_bytes
from camkit.runtime.proof.golden_run import case_work
from tests.bundle_factory import PITCH_UM, tiny_manifest, tiny_members
from tests.planes_bundle import planes_sensor, write_planes_bundle
from tests.psf_factory import grid_psf, streak_kernel

EXAMPLES = Path(__file__).resolve().parents[1] / "data"


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """A sound bundle, taken apart.

    Attributes:
        manifest: As plain data, the hashes of its members included.
        members: Name -> content, without the manifest.
    """

    manifest: dict[str, Any]
    members: dict[str, bytes]


@cache
def bases() -> tuple[Base, ...]:
    """Give the tiny camera, one of a grid of kernels without a network, and both examples."""
    tiny = bundle_from_bytes(
        bundle_to_bytes(tiny_manifest(), tiny_members()), path=Path("tiny.camkit")
    )
    proved = tiny_members() | {GOLDEN: _golden_of(tiny)}
    with tempfile.TemporaryDirectory() as folder:
        grid = _write_grid(Path(folder)).path.read_bytes()
    return (
        _taken_apart(bundle_to_bytes(tiny_manifest(), proved)),
        _taken_apart(grid),
        _taken_apart((EXAMPLES / "example-1.0.camkit").read_bytes()),
        _taken_apart((EXAMPLES / "example-2.0.camkit").read_bytes()),
    )


def _golden_of(bundle: Bundle) -> bytes:
    """Give the golden cases of a bundle with what its pipeline makes of them."""
    arrays = golden_from_bytes(bundle.member(GOLDEN))
    made = {}
    for case in bundle.manifest.golden:
        given = arrays[case.name]
        size = next(iter(bundle.manifest.sizes), None)
        picture = case_work(bundle, case, given, size).fill()
        made[case.name] = GoldenArrays(
            capture=given.capture,
            reference=np.zeros_like(picture),
            outputs={"image": {size or NO_SIZE: picture}},
        )
    return golden_to_bytes(made)


def _write_grid(folder: Path) -> Bundle:
    turns = ((0.0, 90.0), (180.0, 270.0))
    kernels = np.array([[streak_kernel(turn, 3, 4) for turn in row] for row in turns])
    corners_mm = np.array([-0.2, 0.2])
    psf = replace(grid_psf(kernels, corners_mm, corners_mm), pixel_pitch_um=PITCH_UM)
    bank = Wiener(
        takes=("light",), block_px=64, overlap_px=16, prior_scale=1e-3, prior_exponent=2.0
    )
    stages = (Linearise(gives=("light",)), bank, Color(takes=("restored",)))
    return write_planes_bundle(folder, stages, sensor=planes_sensor(), psf=psf)


def _taken_apart(data: bytes) -> Base:
    bundle = bundle_from_bytes(data, path=Path("base.camkit"))
    members = {name: bundle.member(name) for name in bundle.names}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        manifest = json.loads(archive.read(MANIFEST))
    return Base(manifest=manifest, members=members)
