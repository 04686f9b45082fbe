"""Costs are those of the tables of the thesis, row by row; what is stored is what is counted."""

import json
import sys
from pathlib import Path

import pytest

from tools.hdr import network_costs

STORED = Path(__file__).resolve().parents[3] / "docs" / "results" / "thesis-networks.json"

# rows of a table: channels in, channels out, kernel, pixels of a side for one of its outputs
VGG = (
    *((3, 64, 3, 1), (64, 64, 3, 1)),
    *((64, 128, 3, 2), (128, 128, 3, 2)),
    *((128, 256, 3, 4), (256, 256, 3, 4), (256, 256, 3, 4), (256, 256, 3, 4)),
    *((256, 512, 3, 8), (512, 512, 3, 8), (512, 512, 3, 8), (512, 512, 3, 8)),
    *((512, 512, 3, 16), (512, 512, 3, 16)),
)
TABLE_5_1 = ((1475, 64, 1, 1), *((64, 64, 3, 1),) * 8, (64, 6, 1, 1))
TABLE_5_2 = (
    *((3, 32, 7, 1), (32, 32, 3, 1), (32, 64, 3, 2), (64, 64, 3, 2)),
    *((64, 128, 3, 4), (128, 128, 3, 4), (128, 256, 3, 8), (256, 256, 3, 8)),
    *((256, 512, 3, 16), (512, 512, 3, 16)),
    *((512, 256, 3, 8), (512, 256, 3, 8), (256, 256, 3, 8)),
    *((256, 128, 3, 4), (256, 128, 3, 4), (128, 128, 3, 4)),
    *((128, 64, 3, 2), (128, 64, 3, 2), (64, 64, 3, 2)),
    *((64, 32, 3, 1), (64, 32, 3, 1), (32, 32, 3, 1), (32, 3, 1, 1)),
)
TABLE_5_3 = (
    *((3, 64, 3, 1), (64, 64, 3, 1)) * 2,
    *((128, 32, 3, 1), (32, 3, 3, 1)),
)
SCALARS_5_1 = 2 * 9


def weights(table):
    return sum(a * b * k * k + b for a, b, k, _ in table)


def kmac(table):
    return sum(a * b * k * k / step**2 for a, b, k, step in table) / 1000


@pytest.fixture(scope="module")
def costs():
    return network_costs.all_costs()


def test_splitting_network_is_table_5_1_behind_vgg_19(costs):
    naive = costs["splitting, 1x1 behind the upsampling"]
    assert naive["parameters"] == weights(VGG) + weights(TABLE_5_1) + SCALARS_5_1
    assert naive["trained"] == weights(TABLE_5_1) + SCALARS_5_1
    assert naive["kmac_per_px"] == pytest.approx(kmac(VGG) + kmac(TABLE_5_1), abs=1e-3)


def test_compressing_early_saves_what_levels_have_fewer_pixels(costs):
    early, naive = costs["splitting"], costs["splitting, 1x1 behind the upsampling"]
    compressed = sum(c / step**2 for c, step in ((67, 1), (128, 2), (256, 4), (512, 8), (512, 16)))
    saved = 64 * (1475 - compressed) / 1000
    assert naive["kmac_per_px"] - early["kmac_per_px"] == pytest.approx(saved, abs=2e-3)
    assert saved == pytest.approx(86.4)
    assert early["parameters"] == naive["parameters"]


def test_highlight_network_is_table_5_2(costs):
    normed = 2 * 2 * (32 + 64 + 128 + 256 + 512) + 2 * 2 * (256 + 128 + 64)
    assert costs["highlight"]["parameters"] == weights(TABLE_5_2) + normed
    assert costs["highlight"]["kmac_per_px"] == pytest.approx(kmac(TABLE_5_2), abs=1e-3)


def test_fusion_network_is_table_5_3(costs):
    assert costs["fusion"]["parameters"] == weights(TABLE_5_3)
    assert costs["fusion"]["kmac_per_px"] == pytest.approx(kmac(TABLE_5_3), abs=1e-3)


def test_all_three_cost_their_sum(costs):
    parts = [costs[name] for name in ("splitting", "highlight", "fusion")]
    for key in ("parameters", "trained", "kmac_per_px"):
        assert costs["all three"][key] == pytest.approx(sum(p[key] for p in parts), abs=2e-3)


def test_stored_costs_are_those_of_today(costs):
    assert json.loads(STORED.read_text(encoding="utf-8")) == costs


def test_both_orders_give_the_same_picture():
    early, late, difference = network_costs.compare_orders(32)
    assert 0 <= difference <= 1e-4
    assert min(early, late) > 0


def test_a_table_is_printed_and_stored(tmp_path, monkeypatch, capsys):
    path = tmp_path / "costs.json"
    one = {"fusion": {"parameters": 1000, "trained": 10, "kmac_per_px": 1.25}}
    monkeypatch.setattr(network_costs, "all_costs", lambda: one)
    monkeypatch.setattr(network_costs, "SIDE_PX", 16)
    monkeypatch.setattr(sys, "argv", ["network_costs", "-o", str(path), "--measure"])
    network_costs.main()
    told = capsys.readouterr().out
    assert "| fusion | 1,000 | 10 | 1.2 |" in told
    assert " s of CPU; they differ by " in told
    assert json.loads(path.read_text(encoding="utf-8")) == one
