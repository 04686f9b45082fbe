from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.color import color_stage
from camkit.runtime.output.linear_dng import LinearDngWriter
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.raw import read_capture
from tests.camera_factory import COLOR_MATRIX

GAINS = (2.0, 1.0, 1.5)
STEP = 1 / (65535 - 1024)


def source(orientation: int = 1) -> Capture:
    return Capture(
        samples=np.zeros((40, 50), np.uint16),
        cfa="RGGB",
        black_level=np.zeros((2, 2), np.float32),
        white_level=4095.0,
        white_balance=GAINS,
        color_matrix=np.array(COLOR_MATRIX),
        orientation=orientation,
        iso=800.0,
        exposure_time_s=0.01,
        noise=None,
        origin_px=None,
        sensor_size_px=None,
        pixel_pitch_um=None,
        bundle_name=None,
        camera="test camera",
        sha256=None,
        notes=(),
    )


def test_planes_come_back_without_white_balance(tmp_path: Path) -> None:
    planes = np.random.default_rng(0).uniform(-0.01, 1, (3, 40, 50)).astype(np.float32)
    facts = PictureFormat(width=50, height=40, color=color_stage(np.array(COLOR_MATRIX), "camera"))
    with LinearDngWriter(tmp_path / "a.dng", facts, source(6), GAINS) as writer:
        writer.write(planes[:, :13])
        writer.write(planes[:, 13:])
    found = read_capture(tmp_path / "a.dng", isolate=False)
    assert found.orientation == 6
    assert found.iso == 800
    assert found.white_balance is not None
    np.testing.assert_allclose(found.white_balance, GAINS, rtol=1e-5)
    linear = found.linear_rows(0, 40) * np.array(GAINS)[:, None, None]
    np.testing.assert_allclose(linear, planes, atol=0.51 * STEP * max(GAINS))


@pytest.mark.parametrize(("output", "orientation"), [("rec709", 1), ("camera", 3)])
def test_other_colour_or_turned_bands_are_refused(
    tmp_path: Path, output: str, orientation: int
) -> None:
    stage = color_stage(None, output)  # type: ignore[arg-type]
    facts = PictureFormat(width=3, height=2, color=stage, orientation=orientation)
    with pytest.raises(ContractError, match="camera RGB"):
        LinearDngWriter(tmp_path / "a.dng", facts, source(), GAINS)


def test_error_leaves_no_file(tmp_path: Path) -> None:
    facts = PictureFormat(width=3, height=2, color=color_stage(None, "camera"))
    with (
        pytest.raises(ContractError),
        LinearDngWriter(tmp_path / "a.dng", facts, source(), GAINS) as writer,
    ):
        writer.write(np.full((3, 2, 3), np.nan, np.float32))
    assert list(tmp_path.iterdir()) == []
