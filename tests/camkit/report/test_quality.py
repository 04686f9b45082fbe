from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.report.quality import (
    BORDER_PX,
    FABRICATION_SEEDS,
    FIELD_SHARES,
    LIGHT_SUFFIXES,
    QUADRANTS,
    Shot,
    crop_origin,
    inner_srgb,
    judge,
    list_set,
    psnr,
    read_picture,
)
from tests.psf_factory import texture


def make_shot(number: int = 0, position: int = 2, **changes: object) -> Shot:
    fields: dict[str, object] = {
        "set_name": "set",
        "picture": Path("a.png"),
        "number": number,
        "position": position,
        "iso": 100.0,
        "psf": "bundle",
    }
    return Shot(**(fields | changes))  # type: ignore[arg-type]


@given(
    st.tuples(st.integers(1, 700), st.integers(1, 500)),
    st.sampled_from(FIELD_SHARES),
    st.sampled_from(QUADRANTS),
)
def test_crops_lie_on_the_sensor_at_even_origins(
    size: tuple[int, int], share: float, quadrant: tuple[int, int]
) -> None:
    sensor = (704, 502)
    x, y = crop_origin(size, sensor, share, quadrant)
    assert x % 2 == 0
    assert y % 2 == 0
    assert 0 <= x <= sensor[0] - size[0]
    assert 0 <= y <= sensor[1] - size[1]


def test_places_go_from_the_axis_to_the_corner() -> None:
    size, sensor = (100, 60), (600, 400)
    assert crop_origin(size, sensor, 0.0, (1, 1)) == (250, 170)
    assert crop_origin(size, sensor, 1.0, (1, 1)) == (500, 340)
    assert crop_origin(size, sensor, 1.0, (-1, 1)) == (0, 340)
    assert crop_origin(size, sensor, 1.0, (1, -1)) == (500, 0)


def test_a_picture_larger_than_the_sensor_is_refused() -> None:
    with pytest.raises(ContractError, match="does not fit"):
        crop_origin((700, 60), (600, 400), 0.0, (1, 1))


def test_lens_copies_rotate_with_the_pictures() -> None:
    seeds = [make_shot(number=i).fabrication_seed for i in range(2 * len(FABRICATION_SEEDS))]
    assert seeds == [*FABRICATION_SEEDS, *FABRICATION_SEEDS]


def test_noise_differs_between_places_but_not_between_lenses() -> None:
    assert make_shot(position=1).noise_seed != make_shot(position=2).noise_seed
    assert make_shot(psf="fresh").noise_seed == make_shot(psf="bundle").noise_seed


def test_a_sharp_picture_is_judged_perfect_and_noise_costs_what_it_should() -> None:
    sharp = texture(128, 128)
    perfect = judge(decode_srgb(sharp), sharp)
    assert perfect.psnr_db > 100
    assert perfect.ssim == pytest.approx(1, abs=1e-4)
    off = np.clip(sharp + 0.01 * np.random.default_rng(0).standard_normal(sharp.shape), 0, 1)
    restored = decode_srgb(off.astype(np.float32))
    assert judge(restored, sharp).psnr_db == pytest.approx(40, abs=0.2)
    assert psnr(*inner_srgb(restored, sharp)) == judge(restored, sharp).psnr_db


def test_the_border_is_not_judged() -> None:
    sharp = texture(128, 128)
    spoiled = decode_srgb(sharp)
    spoiled[:, :BORDER_PX] = 0
    spoiled[:, :, -BORDER_PX:] = 1
    assert judge(spoiled, sharp).psnr_db > 100


def test_pictures_are_read_linear_and_greys_replicated(tmp_path: Path) -> None:
    grey = np.full((20, 30), 188, np.uint8)
    cv2.imwrite(str(tmp_path / "grey.png"), grey)
    (tmp_path / "notes.txt").write_text("no picture")
    (path,) = list_set(tmp_path)
    scene = read_picture(path)
    assert scene.shape == (3, 20, 30)
    np.testing.assert_allclose(scene, 0.5029, atol=1e-3)
    assert read_picture(path, 16).shape == (3, 16, 16)


@pytest.mark.parametrize("suffix", LIGHT_SUFFIXES)
def test_linear_light_is_taken_as_it_is_and_may_exceed_white(tmp_path: Path, suffix: str) -> None:
    light = np.full((20, 30, 3), 0.5, np.float32)
    light[4] = 40
    written = tmp_path / f"x{suffix.upper()}"
    if suffix == ".hdr":
        written.write_bytes(cv2.imencode(suffix, light)[1].tobytes())
    else:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": light}).write(str(written))
    (path,) = list_set(tmp_path)
    scene = read_picture(path)
    assert set(np.unique(scene)) == {0.5, 40}
    assert scene[:, 4].min() == 40


@pytest.mark.parametrize(("lowest", "fine"), [(-0.005, True), (-0.05, False)])
def test_faint_negatives_are_dark_and_others_refused_by_name(
    tmp_path: Path, lowest: float, fine: bool
) -> None:
    light = np.full((20, 30, 3), 1.0, np.float32)
    light[4] = lowest
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": light}).write(str(tmp_path / "x.exr"))
    if fine:
        assert read_picture(tmp_path / "x.exr").min() == 0
    else:
        with pytest.raises(DecodeError, match=r"x\.exr: samples down to -0\.0[45]"):
            read_picture(tmp_path / "x.exr")


def test_a_folder_without_pictures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="holds no pictures"):
        list_set(tmp_path)
    with pytest.raises(ContractError, match="no folder"):
        list_set(tmp_path / "absent")
