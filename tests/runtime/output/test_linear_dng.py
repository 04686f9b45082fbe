from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError, DecodeError
from camkit.runtime.color import color_stage
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.linear_dng import LinearDngWriter
from camkit.runtime.output.origin import Origin
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.raw import read_capture
from tests.camera_factory import COLOR_MATRIX

GAINS = (2.0, 1.0, 1.5)
STEP = 1 / 65535


ORIGIN = Origin(
    camera="test camera",
    metadata=Metadata(iso=800.0, exposure_time_s=0.01),
    orientation=6,
    white_balance=GAINS,
    color_matrix=np.array(COLOR_MATRIX),
)


def test_planes_come_back_without_white_balance(tmp_path: Path) -> None:
    planes = np.random.default_rng(0).uniform(-0.01, 1, (3, 40, 50)).astype(np.float32)
    stage = color_stage(np.array(COLOR_MATRIX), "camera")
    facts = PictureFormat(width=50, height=40, color=stage, origin=ORIGIN)
    with LinearDngWriter(tmp_path / "a.dng", facts) as writer:
        writer.write(planes[:, :13])
        writer.write(planes[:, 13:])
    found = read_capture(tmp_path / "a.dng", isolate=False)
    assert (found.orientation, found.iso, found.exposure_time_s) == (6, 800, 0.01)
    assert "test camera" in found.camera
    assert found.color_matrix is not None
    np.testing.assert_allclose(found.color_matrix, COLOR_MATRIX, atol=1e-4)
    assert found.white_balance is not None
    np.testing.assert_allclose(found.white_balance, GAINS, rtol=1e-5)
    linear = found.linear_rows(0, 40) * np.array(GAINS)[:, None, None]
    np.testing.assert_allclose(linear, np.maximum(planes, 0), atol=0.51 * STEP * max(GAINS))
    assert not found.black_level.any(), "not every program subtracts it"


@pytest.mark.parametrize(("output", "orientation"), [("rec709", 1), ("camera", 3)])
def test_other_colour_or_turned_bands_are_refused(
    tmp_path: Path, output: str, orientation: int
) -> None:
    stage = color_stage(None, output)  # type: ignore[arg-type]
    facts = PictureFormat(width=3, height=2, color=stage, orientation=orientation)
    with pytest.raises(ContractError, match="camera RGB"):
        LinearDngWriter(tmp_path / "a.dng", facts)


def test_error_leaves_nothing_that_can_be_read(tmp_path: Path) -> None:
    facts = PictureFormat(width=3, height=2, color=color_stage(None, "camera"))
    with (
        pytest.raises(ContractError),
        LinearDngWriter(tmp_path / "a.dng", facts) as writer,
    ):
        writer.write(np.full((3, 2, 3), np.nan, np.float32))
    with pytest.raises(DecodeError):
        read_capture(tmp_path / "a.dng", isolate=False)


def test_one_channel_is_written_as_three_planes_of_grey(tmp_path: Path) -> None:
    origin = replace(ORIGIN, white_balance=(1.0,), color_matrix=None)
    facts = PictureFormat(width=50, height=40, color=color_stage(None, "camera"), origin=origin)
    grey = np.random.default_rng(0).random((1, 40, 50), dtype=np.float32).repeat(3, axis=0)
    with LinearDngWriter(tmp_path / "a.dng", facts) as writer:
        writer.write(grey)
    found = read_capture(tmp_path / "a.dng", isolate=False)
    np.testing.assert_allclose(found.linear_rows(0, 40), grey, atol=0.51 * STEP)


def test_a_camera_whose_name_is_not_ascii_is_named_in_metadata(tmp_path: Path) -> None:
    """UniqueCameraModel is ASCII, Make and Model are not."""
    origin = replace(ORIGIN, camera="Größe 7", metadata=Metadata(make="Größe", model="7"))
    stage = color_stage(np.array(COLOR_MATRIX), "camera")
    facts = PictureFormat(width=50, height=40, color=stage, origin=origin)
    with LinearDngWriter(tmp_path / "a.dng", facts) as writer:
        writer.write(np.random.default_rng(0).random((3, 40, 50), dtype=np.float32))
    found = read_capture(tmp_path / "a.dng", isolate=False)
    assert (found.metadata.make, found.camera) == ("Größe", "Gr??e 7")
