"""Pairs of a camera of developed pictures: two photographs from one place, by tone and halves."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from camkit.bundle.light_bound import LightBound
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.aligned_pairs import align_pairs
from camkit.models_def.kinds.bayer.fine_tuning.alignment import Aligner
from camkit.models_def.kinds.bayer.fine_tuning.homography import map_points
from camkit.models_def.kinds.bayer.fine_tuning.pair_settings import PairSettings
from camkit.models_def.kinds.bayer.fine_tuning.pairs import read_pairs
from tests.developed_pair import BLUR_PX, SETTINGS, SHIFT_PX, write_developed_pair


@pytest.fixture(scope="module")
def folder(tmp_path_factory, planes_recipe):
    home = tmp_path_factory.mktemp("developed")
    write_developed_pair(home, planes_recipe.sensor)
    return home


@pytest.fixture(scope="module")
def samples(folder, planes_recipe, bank):
    many = replace(planes_recipe.fine_tuning, pair_samples=24)
    return read_pairs(folder, replace(planes_recipe, fine_tuning=many), bank, None, seed=1)


@pytest.fixture(scope="module")
def pair(folder, planes_recipe, bank):
    (one,) = align_pairs(folder, planes_recipe, Aligner(planes_recipe.sensor, bank, None))
    return one


def test_photographs_from_one_place_are_aligned_without_features(samples):
    found = samples.alignments["one_l"]
    corners = np.array([[x, y] for x in (50, 550) for y in (50, 350)], dtype=np.float64)
    gap = map_points(found.matrix, corners) - corners - [SHIFT_PX, -SHIFT_PX]
    assert np.linalg.norm(gap, axis=1).max() < 0.1
    assert found.correlation > 0.95


def test_references_have_the_light_of_the_captures_in_every_colour(pair):
    light, counts = pair.target((20, 100), (560, 280))
    assert counts.all()
    blurred = np.stack([cv2.GaussianBlur(p, (0, 0), BLUR_PX) for p in light])[:, 8:-8, 8:-8]
    capture = pair.pair.capture[:, 108:372, 28:572]
    for one, other in zip(blurred, capture, strict=True):
        assert one.mean() == pytest.approx(other.mean(), rel=0.005)
        left, right = (p[:, :200].mean() for p in (one, other))
        assert left == pytest.approx(right, rel=0.01)
    here = np.square(blurred - capture).mean()
    beside = np.square(np.roll(blurred, 1, -1) - capture).mean()
    assert here < 0.05 * beside


def test_targets_lie_on_the_captures(samples):
    planes = torch.from_numpy(samples.planes.astype(np.float32))
    target = torch.from_numpy(samples.targets.astype(np.float32))
    whole = (target >= 0).flatten(1).all(1)
    assert planes.shape == (24, 6, 64, 64)
    assert whole.sum() >= 12
    blurred = torch.from_numpy(
        np.stack([[cv2.GaussianBlur(p, (0, 0), BLUR_PX) for p in t] for t in target.numpy()])
    )
    here = (blurred - planes[:, :3])[whole].square().mean()
    beside = (torch.roll(blurred, 2, -1) - planes[:, :3])[whole].square().mean()
    assert here < 0.3 * beside


def test_clipped_light_of_a_reference_is_not_judged(folder, planes_recipe, bank):
    settings = f"{SETTINGS}\nparts = [[260, 20, 380, 140]]\n"
    samples = read_pairs(with_settings(folder, settings), planes_recipe, bank, None, seed=1)
    judged = samples.targets >= 0
    # all but the lamp, which every square of that part holds most of
    assert 0.5 <= judged.mean() < 0.95
    assert (judged.any(1) == judged.all(1)).all()


def with_settings(folder, text):
    """Return a folder of the same pictures with other settings, beside it."""
    other = folder.parent / f"{folder.name}-{abs(hash(text))}"
    if not other.exists():
        other.mkdir()
        for name in ("capture", "reference", "maker.toml"):
            (other / name).symlink_to(folder / name)
        (other / "pairs.toml").write_text(text, encoding="utf-8")
    return other


def test_parts_alone_are_judged(folder, planes_recipe, bank):
    settings = f"{SETTINGS}\nparts = [[0, 0, 300, 400]]\n"
    half = read_pairs(with_settings(folder, settings), planes_recipe, bank, None, seed=1)
    judged = half.targets >= 0
    assert judged.mean() > 0.5
    # what is judged of a square is a run of columns at its left
    columns = judged.any((1, 2))
    assert (np.diff(columns.astype(int), axis=1) <= 0).all()
    assert not columns.all()


def test_parts_too_small_for_a_sample_are_refused(folder, planes_recipe, bank):
    settings = f"{SETTINGS}\nparts = [[0, 0, 20, 20]]\n"
    with pytest.raises(ContractError, match=r"pair one_l: no square of 64 px .* parts are too"):
        read_pairs(with_settings(folder, settings), planes_recipe, bank, None, seed=1)


def test_a_folder_of_folders_gives_the_pairs_of_all(folder, planes_recipe, bank, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).symlink_to(folder)
    samples = read_pairs(tmp_path, planes_recipe, bank, None, seed=1)
    assert set(samples.alignments) == {"a/one_l", "b/one_l"}
    assert len(samples.planes) == 2 * planes_recipe.fine_tuning.pair_samples


def test_samples_hold_the_masks_that_a_bound_on_light_needs(folder, planes_recipe, bank):
    bounded = replace(planes_recipe, light=LightBound(spread=0.2, keeps_bright=True))
    samples = read_pairs(folder, bounded, bank, None, seed=1)
    batch = samples.draw_batch(np.random.default_rng(1), 2, 32)
    assert batch.planes.shape == (2, 6, 32, 32)
    assert batch.masks["kept"].shape == (2, 1, 32, 32)
    mixed = samples.mixer(0.5, 1)(batch, 3)
    assert mixed.masks["kept"].shape == (2, 1, 32, 32)


def test_photographs_of_two_places_are_refused(folder, planes_recipe, bank, tmp_path):
    (tmp_path / "capture").symlink_to(folder / "capture")
    (tmp_path / "reference").mkdir()
    for half in "lr":
        picture = cv2.imread(str(folder / "reference" / f"one_{half}.png"))
        wide = cv2.warpAffine(picture, np.array([[1.1, 0, -30], [0, 1.1, -20]]), (600, 400))
        cv2.imwrite(str(tmp_path / "reference" / f"one_{half}.png"), wide)
    text = (folder / "maker.toml").read_text(encoding="utf-8")
    (tmp_path / "maker.toml").write_text(text, encoding="utf-8")
    (tmp_path / "pairs.toml").write_text(SETTINGS, encoding="utf-8")
    with pytest.raises(ContractError, match=r"pair one_l: reference and capture"):
        read_pairs(tmp_path, planes_recipe, bank, None, seed=1)


def test_the_distance_of_pairs_is_told_to_the_filter(planes_recipe):
    wiener = planes_recipe.wiener.model_copy(update={"depth": "estimated"})
    lens = replace(planes_recipe.lens, depths_mm=(500.0, 1000.0, 2000.0))
    deep = replace(planes_recipe, wiener=wiener, lens=lens)
    for depth_m, number in ((0.5, 0.0), (1.0, 1.0), (2.0, 2.0), (4 / 3, 1.5)):
        settings = PairSettings(iso=100.0, depth_m=depth_m)
        assert settings.depth_in(deep) == pytest.approx(number)
    with pytest.raises(ContractError, match=r"within the PSF, 0\.5 to 2 m; got 3"):
        PairSettings(iso=100.0, depth_m=3.0).depth_in(deep)
