from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.bundle.reader import Bundle
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.report.quality import (
    BORDER_PX,
    FABRICATION_SEEDS,
    FIELD_SHARES,
    QUADRANTS,
    TUNING_SEED,
    Shot,
    bundle_restorer,
    crop_origin,
    expose,
    finish_planes,
    judge,
    list_set,
    psnr,
    read_picture,
)
from tests.deep_bundle import write_deep_bundle
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


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


def test_lens_copies_rotate_with_the_pictures_and_tuning_has_its_own() -> None:
    seeds = [make_shot(number=i).fabrication_seed for i in range(6)]
    assert seeds == [*FABRICATION_SEEDS, *FABRICATION_SEEDS]
    assert TUNING_SEED not in FABRICATION_SEEDS


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
    assert psnr(restored, sharp) == judge(restored, sharp).psnr_db


def test_the_border_is_not_judged() -> None:
    sharp = texture(128, 128)
    spoiled = decode_srgb(sharp)
    spoiled[:, :BORDER_PX] = 0
    spoiled[:, :, -BORDER_PX:] = 1
    assert judge(spoiled, sharp).psnr_db > 100


def test_the_clean_picture_in_sensor_geometry_is_the_truth(bundle: Bundle) -> None:
    scene = decode_srgb(texture(150, 170))
    exposed = expose(make_shot(), scene, bundle, bundle.psf)
    planes = exposed.simulation.clean
    from camkit.runtime.geometry.illumination import illumination_band

    shaded = planes * illumination_band(bundle.psf, exposed.simulation.window, 0, 150)
    assert judge(finish_planes(shaded, exposed, bundle), exposed.sharp).psnr_db > 80


def test_developing_only_matches_the_brightness_of_the_sharp_picture(bundle: Bundle) -> None:
    scene = np.full((3, 120, 160), 0.3, np.float32)
    exposed = expose(make_shot(position=4), scene, bundle, bundle.psf)
    developed = finish_planes(exposed.local.planes, exposed, bundle)
    np.testing.assert_allclose(developed.mean(axis=(1, 2)), 0.3, rtol=0.01)


def test_the_wiener_bank_beats_the_capture_through_its_own_lens(bundle: Bundle) -> None:
    scene = decode_srgb(texture(150, 170))
    exposed = expose(make_shot(), scene, bundle, bundle.psf)
    developed = judge(finish_planes(exposed.local.planes, exposed, bundle), exposed.sharp)
    restored = judge(bundle_restorer(bundle, method="wiener")(exposed), exposed.sharp)
    assert restored.psnr_db > developed.psnr_db + 0.5


def test_a_network_answers_in_sensor_geometry(bundle: Bundle) -> None:
    exposed = expose(make_shot(), decode_srgb(texture(100, 140)), bundle, bundle.psf)
    assert bundle_restorer(bundle, size="M")(exposed).shape == (3, 100, 140)


def test_a_size_that_the_bundle_lacks_is_refused(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="holds size"):
        bundle_restorer(bundle, size="L")


def test_pictures_are_read_linear_and_greys_replicated(tmp_path: Path) -> None:
    grey = np.full((20, 30), 188, np.uint8)
    cv2.imwrite(str(tmp_path / "grey.png"), grey)
    (tmp_path / "notes.txt").write_text("no picture")
    (path,) = list_set(tmp_path)
    scene = read_picture(path)
    assert scene.shape == (3, 20, 30)
    np.testing.assert_allclose(scene, 0.5029, atol=1e-3)
    assert read_picture(path, 16).shape == (3, 16, 16)


def test_a_folder_without_pictures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="holds no pictures"):
        list_set(tmp_path)
    with pytest.raises(ContractError, match="no folder"):
        list_set(tmp_path / "absent")


def test_a_camera_of_several_depths_is_judged_at_its_focus(tmp_path: Path) -> None:
    deep = write_deep_bundle(tmp_path)
    scene = decode_srgb(texture(150, 170))
    exposed = expose(make_shot(), scene, deep, deep.psf)
    assert exposed.simulation.depth_mm == 1000.0
    expected = deep.psf.kernels.mean(axis=1)[0, 0]
    np.testing.assert_allclose(exposed.local.psf.kernels[0, 1], expected, atol=1e-6)
    assert judge(bundle_restorer(deep, method="wiener")(exposed), exposed.sharp).psnr_db > 15
