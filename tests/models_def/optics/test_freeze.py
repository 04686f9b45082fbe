import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.sensor import BayerSensor, nested_sensor
from camkit.bundle.stages import Wiener
from camkit.errors import ContractError
from camkit.models_def.optics import freeze as freeze_module
from camkit.models_def.optics import sampling_loss
from camkit.models_def.optics.freeze import between_mm, choose_depths
from camkit.models_def.optics.frozen import FreezeGrid, freeze
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.prescription import read_prescription
from camkit.models_def.optics.sampling_loss import (
    Bench,
    block_loss,
    frozen_loss,
    make_bench,
    mean_kernel_loss,
)
from tests.together_factory import TOGETHER

MODELS = Path(__file__).resolve().parents[3] / "models_def"

DUET = MODELS / "prescriptions" / "duet.toml"
SETTINGS = Wiener(prior_scale=3e-4, prior_exponent=2.5)
SMALL = FreezeGrid()
DEPTHS_MM = (2e4, 3e4, 6e4, math.inf)


def duet(rays: int = 400) -> LensOptics:
    return LensOptics(lens=read_prescription(DUET), rays=rays)


def _shrink(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(sampling_loss, "PLACES", 2)
    patch.setattr(sampling_loss, "TRUE_WAVELENGTHS", 5)
    patch.setattr(sampling_loss, "OFFSETS", (-0.8, 0.8))
    patch.setattr(sampling_loss, "BLOCK_HEIGHTS", (0.9,))
    patch.setattr(sampling_loss, "PROBE_SCENES", 1)
    patch.setattr(sampling_loss, "REFERENCE_PX", 512)


@pytest.fixture(scope="module")
def sensor() -> BayerSensor:
    table = tomllib.loads((MODELS / "recipes" / "duet.toml").read_text())
    return BayerSensor.model_validate(nested_sensor(table["sensor"]))


@pytest.fixture(scope="module")
def bench(sensor: BayerSensor) -> Bench:
    patch = pytest.MonkeyPatch()
    _shrink(patch)
    made = make_bench(duet(500), sensor, SETTINGS, copies=1, grid=SMALL)
    patch.undo()
    return made


def test_coarse_samples_lose_more_than_dense_ones(sensor: BayerSensor, bench: Bench) -> None:
    coarse, dense = (
        frozen_loss(
            freeze(duet(), sensor, replace(SMALL, fields=grid[0], wavelengths=grid[1])).psf, bench
        ).mean_db
        for grid in ((3, 3), (17, 7))
    )
    assert coarse > dense + 0.1
    assert dense < 0.3


def test_psf_traced_at_the_very_places_loses_nothing(bench: Bench) -> None:
    assert frozen_loss(bench.nominal, bench).mean_db == 0


def test_block_losses_are_measured_where_the_block_answers(bench: Bench) -> None:
    """A block much smaller than the kernel loses badly."""
    tiny = SETTINGS.model_copy(update={"block_px": 192, "overlap_px": 64})
    usual = SETTINGS.model_copy(update={"block_px": 384, "overlap_px": 160})
    with pytest.MonkeyPatch.context() as patch:
        _shrink(patch)
        lost = [block_loss(bench.nominal, bench, grid).mean_db for grid in (tiny, usual)]
    assert lost[0] > lost[1]
    assert lost[1] < 3


def test_freezing_writes_the_psf_and_reports_what_it_cost(
    sensor: BayerSensor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _shrink(monkeypatch)
    monkeypatch.setattr(freeze_module, "FIELD_COUNTS", (5, 9))
    monkeypatch.setattr(freeze_module, "WAVELENGTH_COUNTS", (3,))
    monkeypatch.setattr(freeze_module, "BLOCKS", ((384, 160),))
    said: list[str] = []
    frozen, told = freeze_module.freeze_samples(
        duet(),
        sensor=sensor,
        settings=SETTINGS.model_copy(update={"block_px": 384, "together": TOGETHER}),
        limit_db=20.0,
        grid=SMALL,
        focus_um=40.0,
        tell=said.append,
    )
    assert said[1].startswith("3 wavelengths, 9 fields: ")
    assert said[2].startswith("3 wavelengths, 5 fields: ")
    assert said[3].startswith("blocks of 384 px, overlap 160: ")
    psf = frozen.psf
    assert psf.kernels.shape[0] == told["fields"] == 5
    assert psf.kernels.shape[-1] == told["side_px"]
    assert told["energy_kept"] >= 0.995
    assert told["loss_db"] <= 20.0
    assert json.loads(json.dumps(told)) == told
    assert (told["block_px"], told["efl_mm"]) == (384, pytest.approx(50, abs=0.1))
    assert said[4].endswith("with its sensor moved by 40 um to both sides")
    assert psf.focus_um is not None
    assert psf.focus_um.tolist() == [-40.0, 40.0]
    assert (told["focus_um"], told["focus_energy_kept"] > 0.98) == (40.0, True)


def test_loss_that_no_grid_can_keep_is_an_error(
    sensor: BayerSensor, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(freeze_module, "FIELD_COUNTS", (3,))
    monkeypatch.setattr(freeze_module, "WAVELENGTH_COUNTS", (3,))
    with pytest.raises(ContractError, match="more than the allowed"):
        freeze_module.choose_grid(duet(), sensor, bench, limit_db=1e-4, grid=SMALL)


@pytest.mark.parametrize(
    ("losses_db", "chosen_px"),
    [((0.01, 0.0), 768), ((0.5, 0.01), 384), ((0.9, 0.3), 384), ((0.34, 0.3), 768)],
)
def test_cheapest_block_grid_that_loses_little_is_taken(
    losses_db: tuple[float, float],
    chosen_px: int,
    bench: Bench,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = dict(zip((768, 384), losses_db, strict=True))
    monkeypatch.setattr(freeze_module, "BLOCKS", ((384, 160), (768, 160)))
    monkeypatch.setattr(freeze_module, "make_probes", lambda *_: ())
    monkeypatch.setattr(
        freeze_module,
        "block_loss",
        lambda _psf, _bench, grid, _probes: sampling_loss.Loss(
            mean_db=known[grid.block_px], worst_db=1.0
        ),
    )
    own = replace(bench, settings=bench.settings.model_copy(update={"block_px": 384}))
    settings, loss = freeze_module.choose_blocks(bench.nominal, own)
    assert settings.block_px == chosen_px
    assert loss.mean_db == known[chosen_px]


@pytest.mark.parametrize(("overlap_share", "chosen_px"), [(1.0, 240), (0.59, 384)])
def test_blocks_that_overlap_less_than_kernels_reach_are_not_tried(
    overlap_share: float, chosen_px: int, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    side_px = bench.nominal.kernels.shape[-1]
    near, far = int(overlap_share * side_px), 2 * side_px
    monkeypatch.setattr(freeze_module, "BLOCKS", ((240, near), (384, far)))
    monkeypatch.setattr(freeze_module, "make_probes", lambda *_: ())
    monkeypatch.setattr(
        freeze_module, "block_loss", lambda *_: sampling_loss.Loss(mean_db=0.1, worst_db=1.0)
    )
    own = bench.settings.model_copy(update={"block_px": 384, "overlap_px": far})
    settings, _ = freeze_module.choose_blocks(bench.nominal, replace(bench, settings=own))
    assert settings.block_px == chosen_px


@pytest.fixture(scope="module")
def deep(sensor: BayerSensor) -> Bench:
    with pytest.MonkeyPatch.context() as patch:
        _shrink(patch)
        grid = FreezeGrid(depths_mm=DEPTHS_MM)
        return make_bench(duet(300), sensor, SETTINGS, copies=1, grid=grid)


def test_as_few_depths_between_the_ends_are_kept_as_the_loss_allows(deep: Bench) -> None:
    assert deep.focus_mm == math.inf
    kept = {db: choose_depths(deep.nominal, deep, limit_db=db) for db in (-9.0, 0.05, 9.0)}
    assert kept[-9.0] == DEPTHS_MM
    assert kept[9.0] == (DEPTHS_MM[0], DEPTHS_MM[-1])
    assert set(kept[9.0]) <= set(kept[0.05]) <= set(DEPTHS_MM)


def test_a_depth_left_out_costs_there_and_in_the_mean_kernel(deep: Bench) -> None:
    nominal = deep.nominal
    thin = replace(nominal, kernels=nominal.kernels[:, [0, 3]], depths_mm=nominal.depths_mm[[0, 3]])
    known = frozen_loss(thin, deep)
    assert known.by_depth_db[0] == known.by_depth_db[3] == 0
    assert min(known.by_depth_db[1:3]) > 0
    assert known.mean_db == pytest.approx(np.mean(known.by_depth_db))
    unknown = mean_kernel_loss(thin, nominal, deep)
    assert mean_kernel_loss(nominal, nominal, deep).by_depth_db == (0, 0, 0, 0)
    assert unknown.mean_db > 0


def test_the_mean_kernel_costs_less_than_that_of_one_end(deep: Bench) -> None:
    """Light from every depth, restored with one kernel, against each with its own."""
    kernels = deep.nominal.kernels
    nearest, mean = (
        frozen_loss(replace(deep.nominal, kernels=one.repeat(4, axis=1)), deep).mean_db
        for one in (kernels[:, :1], kernels.mean(axis=1, keepdims=True))
    )
    assert nearest > 2 * mean > 0


def test_half_way_is_half_way_in_diopters() -> None:
    assert between_mm((1000.0,)) == ()
    assert between_mm((500.0, 1000.0, math.inf)) == pytest.approx((2000 / 3, 2000.0))


def test_freezing_at_several_depths_reports_those_kept_and_the_loss_between(
    sensor: BayerSensor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _shrink(monkeypatch)
    monkeypatch.setattr(sampling_loss, "PATCH_PX", 192)
    monkeypatch.setattr(freeze_module, "FIELD_COUNTS", (5,))
    monkeypatch.setattr(freeze_module, "WAVELENGTH_COUNTS", (3,))
    monkeypatch.setattr(freeze_module, "BLOCKS", ((384, 160),))
    frozen, told = freeze_module.freeze_samples(
        duet(200),
        sensor=sensor,
        limit_db=20.0,
        grid=FreezeGrid(depths_mm=(2e4, 4e4, math.inf)),
    )
    psf = frozen.psf
    assert psf.depths_mm.tolist() == [2e4, math.inf]
    assert psf.kernels.shape[:3] == (5, 2, 3)
    assert told["depths_mm"] == "20000, inf"
    assert told["between_loss_db"] > 0
    assert psf.focus_um is None
    assert "focus_um" not in told


def test_without_depths_a_lens_is_frozen_at_its_own_distance(
    sensor: BayerSensor, monkeypatch: pytest.MonkeyPatch
) -> None:
    lens = replace(read_prescription(DUET), object_distance_mm=3e4)
    near = LensOptics(lens=lens, rays=100)
    monkeypatch.setattr(sampling_loss, "PLACES", 1)
    monkeypatch.setattr(sampling_loss, "TRUE_WAVELENGTHS", 1)
    bench = make_bench(near, sensor, SETTINGS, copies=0)
    assert (bench.depths_mm, bench.focus_mm) == ((3e4,), 3e4)
    grid = FreezeGrid(fields=2, wavelengths=1, energy=0.9)
    assert freeze(near, sensor, grid).psf.depths_mm.tolist() == [3e4]


def test_blocks_are_judged_by_the_bank_of_the_recipe(bench: Bench) -> None:
    """One that restores colours together mistrusts its kernel by the height of its place."""
    losses = []
    for mistrust in (1.0, 30.0):
        together = TOGETHER.model_copy(update={"mistrust": mistrust})
        grid = SETTINGS.model_copy(update={"block_px": 256, "together": together})
        with pytest.MonkeyPatch.context() as patch:
            _shrink(patch)
            losses.append(block_loss(bench.nominal, bench, grid).mean_db)
    assert losses[0] != losses[1]


def test_freezing_quickly_has_the_kernels_of_its_grid_and_measures_no_loss(
    sensor: BayerSensor,
) -> None:
    told: list[str] = []
    grid = FreezeGrid(depths_mm=(2e4, math.inf))
    frozen, facts = freeze_module.freeze_quickly(duet(), sensor=sensor, grid=grid, tell=told.append)
    same = freeze(duet(), sensor, replace(grid, fields=7, wavelengths=5)).psf
    assert np.array_equal(frozen.psf.kernels, same.kernels)
    assert (facts["fields"], facts["wavelengths"], facts["quick"]) == (7, 5, "no search")
    assert (facts["block_px"], facts["depths_mm"]) == (240, "20000, inf")
    assert not [name for name in facts if "loss" in name]
    assert len(told) == 1


@pytest.mark.parametrize(
    ("side_px", "blocks"), [(9, (240, 80)), (147, (256, 96)), (401, (512, 192))]
)
def test_usual_blocks_overlap_as_far_as_kernels_reach(
    side_px: int, blocks: tuple[int, int]
) -> None:
    assert freeze_module.usual_blocks(side_px) == blocks
