"""Real pairs become samples whose target lies on the capture, whatever the lens distorts."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from camkit.colorimetry import camera_from_rec709, encode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.models_def.kinds.bayer.fine_tuning.homography import map_points
from camkit.models_def.kinds.bayer.fine_tuning.pair_photographs import read_capture
from camkit.models_def.kinds.bayer.fine_tuning.pairs import read_pairs
from camkit.models_def.kinds.bayer.samples import corner_height_mm
from camkit.radial import RadialDistortion
from camkit.scenes import procedural_scene

TRUE = np.array([[0.9, -0.03, 35.0], [0.03, 0.9, 15.0], [3e-5, -2e-5, 1.0]])
ROW = np.array([1.0, -0.04, 0.008, 0.0])
EXPOSURE = 0.6


@pytest.fixture(scope="module")
def distortion(recipe):
    return RadialDistortion(coefficients=np.tile(ROW, (3, 1)), radius_mm=corner_height_mm(recipe))


def ideal_positions(recipe, x, y):
    """Undo the distortion by fixed-point iteration, one point after the other."""
    sensor = recipe.sensor
    centre = np.array([sensor.width_px - 1, sensor.height_px - 1]) / 2
    radius_px = corner_height_mm(recipe) * 1000 / sensor.pixel_pitch_um
    sensor = (np.stack([x, y], -1) - centre) / radius_px
    ideal = sensor
    for _ in range(50):
        square = (ideal**2).sum(-1, keepdims=True)
        ideal = sensor / (ROW[0] + ROW[1] * square + ROW[2] * square**2)
    return ideal * radius_px + centre


@pytest.fixture(scope="module")
def folder(tmp_path_factory, recipe, bank):
    """One pair: a picture, and what a lens that distorts and vignettes makes of it."""
    home = tmp_path_factory.mktemp("pairs")
    sensor = recipe.sensor
    shown = np.clip(procedural_scene(11, 440, 620), 0, 1)
    srgb = np.rint(255 * encode_srgb(shown)).astype(np.uint8)
    y, x = np.mgrid[0 : sensor.height_px, 0 : sensor.width_px].astype(np.float64)
    at = map_points(np.linalg.inv(TRUE), ideal_positions(recipe, x, y).reshape(-1, 2))
    at = at.reshape(*x.shape, 2).astype(np.float32)
    planes = [
        cv2.remap(p, at[..., 0], at[..., 1], cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_CONSTANT)
        for p in shown
    ]
    matrix, _ = camera_from_rec709(np.array(sensor.color_matrix))
    light = EXPOSURE * np.tensordot(matrix, np.stack(planes), 1)
    heights = np.hypot(x - x.mean(), y - y.mean()) * sensor.pixel_pitch_um / 1000
    light *= np.interp(heights, bank.frozen_heights_mm, bank.relative_illumination)
    capture = np.clip([cv2.GaussianBlur(p, (0, 0), 1.0) for p in light], 0, 1)
    for name in ("capture", "reference"):
        (home / name).mkdir()
    counts = np.rint(65535 * capture).astype(np.uint16)
    cv2.imwrite(str(home / "capture" / "one.tiff"), counts[::-1].transpose(1, 2, 0))
    cv2.imwrite(str(home / "reference" / "one.png"), srgb[::-1].transpose(1, 2, 0))
    (home / "pairs.toml").write_text("iso = 100.0\n", encoding="utf-8")
    return home


@pytest.fixture(scope="module")
def samples(folder, recipe, bank, distortion):
    return read_pairs(folder, recipe, bank, distortion, seed=1)


def test_homography_behind_the_distortion_is_found_to_a_tenth_of_a_pixel(samples):
    corners = np.array([[x, y] for x in (0, 310, 619) for y in (0, 220, 439)], dtype=np.float64)
    found = samples.alignments["one"].matrix
    gap = map_points(found, corners) - map_points(TRUE, corners)
    assert np.linalg.norm(gap, axis=1).max() < 0.1


def test_targets_lie_on_the_captures_in_their_colours(samples):
    planes = torch.from_numpy(samples.planes.astype(np.float32))
    assert planes.shape == (4, 6, 64, 64)
    capture, target = planes[:, :3], torch.from_numpy(samples.targets.astype(np.float32))
    judged = target >= 0
    assert judged.float().mean() > 0.5
    blurred = torch.from_numpy(
        np.stack([[cv2.GaussianBlur(p, (0, 0), 1.0) for p in t] for t in target.numpy()])
    )
    here = ((blurred - capture)[judged]).square().mean()
    beside = ((torch.roll(blurred, 1, -1) - capture)[judged]).square().mean()
    assert here < 0.5 * beside
    whole = judged.flatten(1).all(1)
    assert whole.any()
    # The squares are linear light; blur does not change its mean.
    means = [x[whole].square().mean().item() for x in (target, capture)]
    assert means[0] == pytest.approx(means[1], rel=0.02)


def test_what_the_reference_does_not_cover_is_not_judged(samples):
    target = samples.targets
    unknown = target < 0
    assert (unknown.any(1) == unknown.all(1)).all()


def test_drawn_patches_depend_on_the_generator_alone(samples):
    one, two = (samples.draw_batch(np.random.default_rng(5), 3, 32) for _ in range(2))
    assert torch.equal(one.planes, two.planes)
    assert (one.planes.shape, one.target.shape) == ((3, 6, 32, 32), (3, 3, 32, 32))
    assert one.weight.shape == (3, 3)


def test_another_reference_is_an_error_that_names_the_pair(tmp_path, folder, recipe, bank):
    for name in ("capture", "reference"):
        (tmp_path / name).mkdir()
    (tmp_path / "capture" / "b.tiff").write_bytes((folder / "capture" / "one.tiff").read_bytes())
    (tmp_path / "pairs.toml").write_text("iso = 100\n", encoding="utf-8")
    with pytest.raises(ContractError, match=r"pair b: .*holds no picture"):
        read_pairs(tmp_path, recipe, bank, None, seed=1)
    cv2.imwrite(str(tmp_path / "reference" / "b.png"), np.full((200, 300, 3), 90, np.uint8))
    with pytest.raises(ContractError, match=r"pair b: .*too few features"):
        read_pairs(tmp_path, recipe, bank, None, seed=1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "one of iso > 0 and noise"),
        ("iso = -1.0", "iso must be > 0"),
        ('iso = "x"', "iso must be a number"),
        ("iso = 100\nblack = 3", "unknown key 'black'"),
        ("iso = 1\nwhite_balance = [1]", r"white_balance must be \[R, G, B\]"),
        ("iso = 1\nnoise = [1e-5, 0]", "one of iso > 0 and noise"),
        ("noise = [0, 0]", r"noise must be \[SHOT, READ_VARIANCE\]"),
        ('iso = 1\nreference = "drawn"', "reference must be one of shown, photographed"),
        ("iso = 1\nparts = [[0, 0, 0, 9]]", r"parts must be rectangles .* got \[0, 0, 0, 9\]"),
        ("iso = 1\ndepth_m = 0", "depth_m must be > 0"),
        ("iso = 1\ndepth_m = 1", "depth_m is for cameras whose filters are told a distance"),
        ('iso = 1\nhalves = ["_l"]', "halves must be two texts"),
        ('iso = 1\ntone = "srgb"', "tone are for cameras of developed pictures"),
    ],
)
def test_wrong_settings_are_refused(tmp_path, recipe, bank, text, said):
    (tmp_path / "pairs.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ContractError, match=said):
        read_pairs(tmp_path, recipe, bank, None, seed=1)


def test_a_folder_without_settings_is_refused(tmp_path, recipe, bank):
    with pytest.raises(ContractError, match=r"real pairs need .*pairs\.toml, with iso at least"):
        read_pairs(tmp_path, recipe, bank, None, seed=1)


def test_captures_of_another_kind_are_refused(tmp_path, folder, recipe, bank):
    path = tmp_path / "x.png"
    cv2.imwrite(str(path), np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(ContractError, match="16-bit RGB, linear; got uint8"):
        read_capture(path)
    path.write_bytes(b"junk")
    with pytest.raises(DecodeError, match="cannot be decoded"):
        read_capture(path)


def test_a_bank_that_finds_the_distance_is_refused(folder, recipe, bank):
    wiener = recipe.wiener.model_copy(update={"depth": "estimated"})
    deep = replace(recipe, wiener=wiener, lens=replace(recipe.lens, depths_mm=(500.0, 1000.0)))
    with pytest.raises(ContractError, match=r"state depth_m in pairs\.toml"):
        read_pairs(folder, deep, bank, None, seed=1)
