"""Colour photographs: photographed by the twin, written, read again and given back as arrays."""

from pathlib import Path

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.kinds import BAYER
from camkit.runtime.kind import runtime_part
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import SimulationOptions

PART = runtime_part(BAYER.name)


def test_what_is_photographed_and_written_is_read_again(bundle: Bundle, tmp_path: Path) -> None:
    scene = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    taken = PART.simulate(scene, bundle, SimulationOptions(iso=400, seed=3))
    path = tmp_path / f"a{PART.suffixes[0]}"
    PART.write(path, taken, bundle)
    read = PART.read(path, None, bundle.manifest, Options())
    np.testing.assert_array_equal(read.samples, taken.samples)
    assert (read.bundle_name, read.iso) == ("tiny", 400)
    again = PART.from_array(
        taken.samples, bundle.manifest, iso=400.0, white_balance=read.white_balance
    )
    np.testing.assert_array_equal(again.samples, read.samples)
    assert (again.cfa, again.white_level) == (read.cfa, read.white_level)


def test_the_pipeline_reads_by_the_kind_of_its_bundle_and_photographs_without_one(
    bundle: Bundle, tmp_path: Path
) -> None:
    scene = np.full((3, 64, 96), 0.3, np.float32)
    path = tmp_path / "a.dng"
    PART.write(path, PART.simulate(scene, bundle, SimulationOptions(noise=False)), bundle)
    captures = [Pipeline(camera, Options()).read(path) for camera in (bundle, None)]
    np.testing.assert_array_equal(*(capture.samples for capture in captures))
