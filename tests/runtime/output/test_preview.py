from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from camkit.colorimetry import apply_matrix, encode_srgb, rec709_to_acescg
from camkit.errors import ContractError
from camkit.runtime.color import color_stage
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.preview import PreviewWriter, average_squares


def preview(
    path: Path, planes: np.ndarray, max_side_px: int, output: str = "rec709", orientation: int = 1
) -> np.ndarray:
    _, height, width = planes.shape
    stage = color_stage(None, output)  # type: ignore[arg-type]
    facts = PictureFormat(width=width, height=height, color=stage, orientation=orientation)
    with PreviewWriter(path, facts, max_side_px=max_side_px) as writer:
        for top in range(0, height, 5):
            writer.write(planes[:, top : top + 5])
    return np.asarray(Image.open(path)).transpose(2, 0, 1)


def test_squares_are_averaged_in_linear_light(tmp_path: Path) -> None:
    planes = np.random.default_rng(0).random((3, 24, 36), dtype=np.float32)
    found = preview(tmp_path / "a.png", planes, 12)
    means = planes.reshape(3, 8, 3, 12, 3).mean(axis=(2, 4))
    assert np.abs(found - encode_srgb(means) * 255).max() <= 0.51


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 50), (50, 1), (23, 37)])
def test_odd_sizes_keep_their_last_squares(tmp_path: Path, height: int, width: int) -> None:
    flat = np.full((3, height, width), 0.5, dtype=np.float32)
    found = preview(tmp_path / "a.png", flat, 10)
    factor = -(-max(height, width) // 10)
    assert found.shape == (3, -(-height // factor), -(-width // factor))
    assert np.ptp(found) == 0


def test_wide_gamut_is_shown_as_rec709(tmp_path: Path) -> None:
    planes = np.random.default_rng(0).random((3, 8, 8), dtype=np.float32)
    wide = apply_matrix(rec709_to_acescg(), planes)
    one = preview(tmp_path / "a.png", planes, 8)
    other = preview(tmp_path / "b.png", wide, 8, "acescg")
    assert np.abs(one.astype(int) - other).max() <= 1


def test_preview_is_turned(tmp_path: Path) -> None:
    planes = np.random.default_rng(0).random((3, 8, 12), dtype=np.float32)
    upright = preview(tmp_path / "a.png", planes, 12)
    turned = preview(tmp_path / "b.png", planes, 12, orientation=3)
    np.testing.assert_array_equal(turned, upright[:, ::-1, ::-1])


def test_average_of_squares_keeps_the_mean() -> None:
    planes = np.random.default_rng(0).random((3, 6, 9), dtype=np.float32)
    assert average_squares(planes, 3).mean() == pytest.approx(planes.mean(), rel=1e-5)


def test_error_releases_the_file(tmp_path: Path) -> None:
    facts = PictureFormat(width=4, height=4, color=color_stage(None))
    with pytest.raises(ContractError), PreviewWriter(tmp_path / "a.png", facts) as writer:
        writer.write(np.full((3, 4, 4), np.nan, np.float32))
