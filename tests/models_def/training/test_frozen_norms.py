"""Norms become constants at a stated cost; then the network tiles exactly, before it is refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.export.graph_measurements import DEEP_ARENA
from camkit.export.network_facts import draft_network
from camkit.models_def.kinds.bayer.samples import LAYOUT
from camkit.models_def.networks.instance_norm import freeze_norms
from camkit.models_def.networks.normed_unet import NormedConfig, NormedUnet
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.frozen_norms import FreezeOptions, freeze_checkpoint
from camkit.models_def.training.trainer import TrainOptions, train
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows
from tests.bayer_recipe import bank, material, one_picture_to_validate_on, recipe  # noqa: F401
from tests.normed_recipe import recipe_path  # noqa: F401

REACH_PX = 128


def options(folder):
    return FreezeOptions(pictures=None, valid=None, cache_folder=folder, samples=4)


def twins():
    torch.manual_seed(6)
    live, frozen = (NormedUnet(NormedConfig(width=4, frozen=f)) for f in (False, True))
    torch.nn.init.normal_(live.tail[-1].weight, std=0.2)
    freeze_norms(live, frozen, [torch.rand(1, 6, 128, 128) for _ in range(3)])
    return live.eval(), frozen.eval()


def test_live_norms_are_refused_at_export_and_frozen_ones_tile_exactly():
    live, frozen = twins()
    with pytest.raises(
        ContractError, match=r"10 norms that look at a whole picture .* freeze-norms"
    ):
        draft_network("network_M", live, LAYOUT)
    draft = draft_network("network_M", frozen, LAYOUT)
    assert (draft.facts.receptive_field_radius_px, draft.facts.stride_px) == (REACH_PX, 64)
    assert draft.facts.global_operators == ()
    graph = inspect_graph(draft.members["network_M.onnx"])
    assert draft.facts.bytes_per_pixel == DEEP_ARENA * graph.bytes_per_pixel
    assert graph.unblocked_convolutions == ()
    picture = np.random.default_rng(1).random((6, 60, 700), dtype=np.float32)
    engine = NetworkEngine(draft.members["network_M.onnx"], threads=1)
    results = []
    for tile_px in (None, 64, 128, 192):
        limits = TileLimits(stride_px=64, halo_px=REACH_PX, max_bytes=2**40, tile_px=tile_px)
        layout = lay_windows(60, 700, limits)
        assert (layout.window_count > 1) == (tile_px is not None)
        results.append(np.concatenate([*infer_bands(engine.run, ArrayRows(picture), layout)], 1))
    assert all(np.array_equal(result, results[0]) for result in results)


def test_reach_is_the_one_counted_by_hand():
    # On the way down a 3x3 and six 4x4 /2 see 1 + (1 + 2 + ... + 32) pixels to the left; on the
    # way up 3x3 at /32 ... /1 see as many, and the last one sees one more.
    assert 1 + sum(2**i for i in range(6)) + sum(2**i for i in range(6)) + 1 == REACH_PX


def test_a_frozen_checkpoint_states_its_cost_and_is_begun_from(
    tmp_path,
    recipe_path,  # noqa: F811
    material,  # noqa: F811
):
    given = TrainOptions(out_dir=tmp_path, size="l1", workers=0)
    trained = train(recipe_path, given, material=material)
    out = tmp_path / "frozen.pt"
    report = freeze_checkpoint(
        recipe_path, trained.checkpoint, out, options(tmp_path), material=material
    )
    assert report.norms == 4
    assert report.live_db == pytest.approx(trained.valid_db, abs=1e-3)
    told = report.to_json()
    assert told["cost_db"] == pytest.approx(told["live_db"] - told["frozen_db"], abs=2e-3)
    saved = read_checkpoint(out)
    assert saved.config == {"width": 4, "stages": 3, "frozen": True}
    assert saved.training_data.endswith(f"norms frozen with 4 samples for {told['cost_db']:.2f} dB")
    network = load_network(saved)
    window = torch.rand(1, 6, 64, 64)
    with torch.no_grad():
        shifted = torch.cat([window, torch.zeros_like(window)], dim=3)
        assert torch.allclose(network(shifted)[..., :8], network(window)[..., :8], atol=1e-5)
    with pytest.raises(ContractError, match="no norms that look at a picture"):
        freeze_checkpoint(recipe_path, out, out, options(tmp_path), material=material)


def test_folders_without_pictures_are_refused_before_anything_is_traced(
    tmp_path,
    recipe_path,  # noqa: F811
):
    for name in ("pictures", "valid"):
        given = replace(options(tmp_path), **{name: tmp_path / "none"})
        with pytest.raises(ContractError, match="none is not there"):
            freeze_checkpoint(recipe_path, tmp_path / "x.pt", tmp_path / "y.pt", given)


def test_numbers_of_samples_are_checked(tmp_path):
    with pytest.raises(ContractError, match="samples must be >= 1"):
        FreezeOptions(pictures=None, valid=None, cache_folder=tmp_path, samples=0)
