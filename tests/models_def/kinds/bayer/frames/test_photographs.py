"""Whole frames are photographed and cleared by the runtime; what is cut from them trains."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.bank_fit import BANK_FITTING
from camkit.models_def.kinds.bayer.frames import photographs
from camkit.models_def.kinds.bayer.frames.photographs import (
    FrameSources,
    _with_surroundings,
    draw_scene,
    physics_bundle,
    prepare_frames,
)
from camkit.models_def.kinds.bayer.frames.samples import TileMaker, developed
from camkit.models_def.kinds.bayer.frames.tiles import Tile, Tiles, read_frames
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import finish_shot
from camkit.models_def.kinds.bayer.scene_light import DisplayRecipe
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.middle import find_middles
from camkit.models_def.sensors.stabilise import stabilise
from camkit.models_def.training.bank_fitting import BankFitOptions
from camkit.models_def.training.checkpoint import read_checkpoint
from camkit.models_def.training.kind import read_recipe, training_kind
from camkit.models_def.training.pictures import open_source
from camkit.models_def.training.trainer import TrainOptions, train
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.light import stated_balance
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from tests.hazy_recipe import HEIGHT_PX, RECIPE, WIDTH_PX, hazy_optics

LENS = {"prescription.toml": b"made up for tests"}


def _silent(_line: str) -> None:
    return


@pytest.fixture(scope="module")
def recipe_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recipe") / "tiny.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def recipe(recipe_path: Path) -> BayerRecipe:
    found = read_recipe(recipe_path)
    assert isinstance(found, BayerRecipe)
    return found


def _sources() -> FrameSources:
    return FrameSources(
        pictures={"train": None, "valid": None},
        optics=hazy_optics(),
        copies=[hazy_optics(share) for share in (0.5, 0.48, 0.52)],
        designed=LENS,
    )


@pytest.fixture(scope="module")
def runs(recipe: BayerRecipe, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    made = prepare_frames(recipe, _sources(), folder, _silent)
    assert (made["train"], made["valid"]) == (24, 8)
    return folder


def _tiles(runs: Path, part: str) -> Tiles:
    return Tiles(runs / "tiny_frames", part)


def test_tiles_hold_the_scene_as_bright_as_it_was(runs: Path) -> None:
    """Half of the light is haze: without the stage a dark place beside a bright one is lost."""
    tiles = _tiles(runs, "train")
    pairs = []
    for index in range(len(tiles)):
        tile = tiles.read(index)
        assert tile.planes.shape == (3, 96, 96)
        assert tile.sharp.shape == (3, 64, 64)
        if not tile.clipped.any():
            inner = tile.planes[:, 16:80, 16:80]
            pairs.append((inner.mean(), tile.sharp.mean()))
    got, true = np.array(pairs).T
    assert len(got) > 4
    np.testing.assert_allclose(got, true, rtol=0.2, atol=0.02)


def test_noise_is_raised_by_what_clearing_multiplies(runs: Path) -> None:
    tile = _tiles(runs, "train").read(0)
    assert all(2 < rise < 8 for rise in tile.noise_rise)


def test_copies_and_isos_to_choose_by_are_their_own(runs: Path) -> None:
    assert set(_tiles(runs, "train").facts("copy")) == {0, 1}
    valid = _tiles(runs, "valid")
    assert set(valid.facts("copy")) == {2}
    assert set(valid.facts("iso")) == {100.0, 1600.0}


def test_copies_are_frozen_at_the_distances_of_the_recipe_in_turn(
    recipe: BayerRecipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, middles = [], set()

    def frozen(lens: Lens, *_: object, middle: str, **__: object) -> tuple[FrozenOptics, None]:
        seen.append(lens.object_distance_mm)
        middles.add(middle)
        return hazy_optics(), None

    monkeypatch.setattr(photographs, "freeze_hazy", frozen)
    distances = (500.0, 2000.0, np.inf)
    choices = replace(
        recipe.lens, depths_mm=distances, copies=3, validation_copies=1, bank_in_focus=True
    )
    told: list[str] = []
    lens = read_lens(Path("duet"))
    deep = replace(recipe, lens=choices, frames=replace(recipe.frames, count=3))
    made = photographs.freeze_copies(deep, lens, told.append)
    assert len(made) == 4
    assert seen == [500.0, 2000.0, np.inf, 500.0]
    assert told[1] == "copy 2 of 4 frozen at 2 m"
    assert middles == {find_middles(lens, 33.0, 5.96, 500).middle}
    seen.clear()
    usual = replace(recipe, lens=replace(recipe.lens, copies=1, validation_copies=1))
    photographs.freeze_copies(usual, lens, told.append)
    assert seen == [lens.object_distance_mm] * 2
    with pytest.raises(ContractError, match=r"state lens\.bank_in_focus = true"):
        replace(deep, lens=replace(choices, bank_in_focus=False))
    with pytest.raises(ContractError, match="must be 3 at least, got 2 and 3"):
        replace(deep, lens=replace(choices, copies=2))
    with pytest.raises(ContractError, match="must be 3 at least, got 3 and 2"):
        replace(deep, frames=replace(deep.frames, count=2))
    for unused in ({"depth_shares": (1.0, 1.0, 2.0)}, {"known_depth_share": 0.5}):
        with pytest.raises(ContractError, match=r"in turn; leave data\.depth_shares"):
            replace(deep, data=replace(recipe.data, **unused))


def test_surroundings_are_mirrored_at_the_border() -> None:
    ramp: NDArray[Any] = np.arange(12.0)[None, :, None] + np.zeros((1, 12, 12))
    cut = _with_surroundings(ramp, 0, 4, 8, 2)
    assert cut[0, :, 0].tolist() == [2, 1, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9]
    below = _with_surroundings(ramp, 4, 4, 8, 2)
    assert below[0, -3:, 0].tolist() == [11, 10, 9]


def test_a_scene_fills_the_sensor(recipe: BayerRecipe) -> None:
    source = open_source(None, picture_share=0.0, scenes=2, scene_px=160)
    scene = draw_scene(np.random.default_rng(1), source, recipe)
    assert scene.shape == (3, HEIGHT_PX, WIDTH_PX)
    assert scene.min() >= 0


def test_the_camera_without_networks_ends_behind_the_bank(
    recipe: BayerRecipe, tmp_path: Path
) -> None:
    bundle = physics_bundle(recipe, hazy_optics(), tmp_path / "x.camkit")
    types = [stage.type for stage in bundle.manifest.stages]
    assert types[3:6] == ["demosaic", "haze", "wiener"]
    assert "network" not in types


def test_a_tile_through_the_bank_is_what_the_runtime_restores(
    recipe: BayerRecipe, runs: Path, tmp_path: Path
) -> None:
    """One block of its own and not those of a bank: nearly the same far from its border."""
    bundle = physics_bundle(recipe, hazy_optics(), tmp_path / "x.camkit")
    source = open_source(None, picture_share=0.0, scenes=2, scene_px=160)
    scene = draw_scene(np.random.default_rng(2), source, recipe, even=True)
    made = photograph(scene, bundle, SimulationOptions(iso=100.0, distort=False))
    pipeline = Pipeline(bundle, Options(threads=1))
    capture = pipeline.capture_of(
        made.samples,
        iso=100.0,
        white_balance=stated_balance(made.white_balance),
        origin_px=(0, 0),
    )
    clear = pipeline.start(capture).keep("clear")
    assert clear.noise_rise is not None
    planes = np.asarray(clear.rows().read(0, HEIGHT_PX), np.float32)
    restored = pipeline.start(capture).keep("restored").rows().read(0, HEIGHT_PX)
    top, left = 88, 128  # about the middle of the sensor
    red, green, blue = clear.noise_rise()
    tile = Tile(
        planes=_with_surroundings(planes, top, left, 64, 16),
        clipped=np.zeros((96, 96), np.bool_),
        sharp=made.clean[:, top : top + 64, left : left + 64],
        x_mm=0.0,
        y_mm=0.0,
        iso=100.0,
        noise_rise=(red, green, blue),
        copy=0,
    )
    shot = finish_shot(developed(tile, recipe, read_frames(runs / "tiny_frames").bank), recipe)
    shot_noise, read_noise = (
        torch.tensor(getattr(shot.noise, name)) for name in ("shot", "read_variance")
    )
    inner = np.s_[:, top : top + 64, left : left + 64]
    wanted = [
        stabilise(torch.from_numpy(np.array(x[inner]))[None], shot_noise, read_noise, scale=64.0)[0]
        for x in (planes, restored)
    ]
    given = shot.sample.inputs
    torch.testing.assert_close(given["capture"], wanted[0])
    off = float((given["wiener"] - wanted[1]).abs()[:, 8:-8, 8:-8].mean())
    done = float((wanted[1] - wanted[0]).abs().mean())
    assert off < 0.1 * done


def test_a_network_trains_on_tiles(recipe_path: Path, runs: Path, tmp_path: Path) -> None:
    (tmp_path / "tiny_frames").symlink_to(runs / "tiny_frames")
    options = TrainOptions(out_dir=tmp_path, size="S", steps=4, workers=0)
    result = train(recipe_path, options)
    assert result.steps == 4
    assert read_checkpoint(result.checkpoint).designed == LENS


def test_the_bank_sharpens_tiles_to_choose_by(recipe: BayerRecipe, runs: Path) -> None:
    kind = training_kind("bayer")
    judge = kind.judge(recipe, "restore", kind.prepare(recipe, Path(), runs), None)
    capture, wiener = (
        judge.score(lambda planes, first=first: planes[:, first : first + 3]).parts["by_iso"]["100"]  # type: ignore[misc]
        for first in (0, 3)
    )
    assert wiener > capture


def test_a_bank_is_fitted_to_tiles(recipe: BayerRecipe, runs: Path) -> None:
    told: list[str] = []
    options = BankFitOptions(
        pictures=None, recipe_folder=Path(), cache_folder=runs, samples=24, steps=2
    )
    found = BANK_FITTING.fit(recipe, options, told.append)
    assert found.samples >= 8
    assert f"{found.samples} samples, {24 - found.samples} left out" in told[0]
    assert len(found.together.spread.heights_mm) == 3


def test_samples_repeat_and_tiles_come_once_before_all_again(
    recipe: BayerRecipe, runs: Path
) -> None:
    kind = training_kind("bayer")
    material = kind.prepare(recipe, Path(), runs)
    maker = kind.maker(recipe, "restore", material, None, 1)
    one, again = maker.make(3), maker.make(3)
    assert one.target.equal(again.target)
    firsts = {float(maker.make(index).target.sum()) for index in range(24)}
    frames = [maker.frame_of(index) for index in range(24)]
    per_frame = recipe.frames.shots * recipe.frames.tiles
    assert np.bincount(frames).tolist() == [per_frame] * recipe.frames.count
    assert len(firsts) == 24
    assert float(maker.make(24).target.sum()) in firsts


def test_samples_tell_how_far_their_scene_is(recipe: BayerRecipe, runs: Path) -> None:
    frames_made = read_frames(runs / "tiny_frames")
    tiles = frames_made.tiles("train", None)
    copies = tiles.facts("copy")
    assert set(copies) == {0, 1}
    assert TileMaker(recipe, frames_made.bank, tiles, 4).distance_mm(0) is None
    far = replace(recipe.lens, depths_mm=(500.0, np.inf), bank_in_focus=True)
    maker = TileMaker(replace(recipe, lens=far), frames_made.bank, tiles, 4)
    order = [maker._tile_of(number) for number in range(len(tiles))]
    found = [maker.distance_mm(number) for number in range(len(tiles))]
    assert found == [(500.0, np.inf)[int(copies[tile])] for tile in order]


def test_frames_are_read_by_another_process(
    recipe: BayerRecipe, runs: Path, tmp_path: Path
) -> None:
    kind = training_kind("bayer")
    material = kind.prepare(recipe, Path(), runs)
    material.write(tmp_path)
    assert kind.read_material(tmp_path).digest() == material.digest()


def test_frames_of_other_pictures_or_another_recipe_are_refused(
    recipe: BayerRecipe, runs: Path, tmp_path: Path
) -> None:
    frames = read_frames(runs / "tiny_frames", recipe)
    (tmp_path / "one.png").touch()
    with pytest.raises(ContractError, match="show other pictures than"):
        frames.tiles("train", tmp_path)
    other = replace(recipe, frames=replace(recipe.frames, count=3))
    with pytest.raises(ContractError, match="photographed for another recipe"):
        read_frames(runs / "tiny_frames", other)
    with pytest.raises(ContractError, match="make them with `camkit prepare`"):
        read_frames(tmp_path, recipe)
    for damaged in ("", "[]", '{"camera": ""}', "\0"):
        (tmp_path / "tiles.json").write_text(damaged)
        with pytest.raises(ContractError, match=r"tiles\.json is damaged; run `camkit prepare`"):
            read_frames(tmp_path)


def test_tiles_that_were_cut_short_or_are_gone_are_one_line(runs: Path, tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    shutil.copytree(runs / "tiny_frames", folder)
    frames = read_frames(folder)
    planes = folder / "train.planes.npy"
    whole = planes.read_bytes()
    for left in (whole[:-1000], whole[:40], b""):
        planes.write_bytes(left)
        with pytest.raises(ContractError, match=r"\(train\) in .* are damaged; run `camkit prep"):
            frames.tiles("train", None)
    planes.unlink()
    with pytest.raises(ContractError, match="are damaged"):
        frames.tiles("train", None)


@pytest.mark.parametrize("calibrated", [False, True])
def test_colours_outside_rec709_are_photographed(
    recipe: BayerRecipe, tmp_path: Path, calibrated: bool
) -> None:
    wide = ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046))
    display = DisplayRecipe(primaries=wide, calibrated=calibrated)
    few = replace(recipe.frames, count=1, validation_count=1, shots=1, tiles=4, validation_tiles=1)
    shown = replace(recipe, frames=few, data=replace(recipe.data, display=display))
    prepare_frames(shown, _sources(), tmp_path, _silent)
    tiles = _tiles(tmp_path, "train")
    for index in range(len(tiles)):
        tile = tiles.read(index)
        assert np.isfinite(tile.planes).all()
        assert tile.sharp.min() >= 0


def test_a_camera_without_a_haze_needs_no_frames(recipe: BayerRecipe, tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="has no haze; its samples are made while it trains"):
        prepare_frames(replace(recipe, haze=None), _sources(), tmp_path, _silent)
