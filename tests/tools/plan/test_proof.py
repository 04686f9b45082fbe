"""The proof of `adaptive`: what a row says of a capture, sums over rows, and the files."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.plan.speed import Speed
from tests.plan_factory import HEIGHT_PX, WIDTH_PX, write_planned_bundle
from tools.plan.proof import ISOS, ProofRow, prove, summarise, write_report
from tools.plan.scenes import ProofScene

ROW = ProofRow(
    kind="sky",
    name="sky:1",
    iso=100.0,
    loss_db=0.02,
    exact_db=30.0,
    saved_work=0.6,
    saved_seconds=0.5,
    saved_cpu=0.4,
    choice="half of the cells",
)
ROWS = [ROW, replace(ROW, loss_db=0.06, saved_work=0.2), replace(ROW, kind="text", loss_db=-0.02)]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_planned_bundle(tmp_path_factory.mktemp("planned"))


def _textured() -> FloatArray:
    blocks = np.random.default_rng(1).random((3, HEIGHT_PX // 4, WIDTH_PX // 4))
    return np.kron(blocks, np.ones((4, 4))).astype(np.float32)


def _half() -> FloatArray:
    scene = _textured()
    scene[:, :, : WIDTH_PX // 2] = 0.3
    return scene


def _scene(make: Callable[[], FloatArray]) -> ProofScene:
    return ProofScene(subject="subject", name=make.__name__, make=partial(make))


def test_a_flat_half_is_saved_and_texture_everywhere_keeps_every_bit_of_exact(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    steady = Speed(
        network_s_per_mp={(DEFAULT_ROLE, "S"): 0.2, (DEFAULT_ROLE, "M"): 0.5},
        block_s=0.02,
        clipped_block_s=5 * 0.02,
        rest_s_per_mp=0.1,
        threads=1,
    )
    monkeypatch.setattr(Reconstruction, "measured_speed", lambda *_: steady)
    half, textured = prove(bundle, iter([_scene(_half), _scene(_textured)]))
    assert (half.iso, textured.iso) == ISOS
    assert 0.1 < half.saved_work < 0.6
    assert half.loss_db != 0
    assert (textured.loss_db, textured.saved_work) == (0.0, 0.0)
    assert 5 < textured.exact_db < half.exact_db
    assert f"saves {half.saved_work:.1%} of network and FFT" in half.line()


def test_a_summary_has_means_and_the_worst_of_every_subject_and_of_all() -> None:
    summary = summarise(ROWS)
    assert list(summary) == ["sky", "text", "all"]
    assert summary["sky"]["captures"] == 2
    assert summary["sky"]["mean_loss_db"] == pytest.approx(0.04)
    assert summary["sky"]["worst_loss_db"] == 0.06
    assert summary["sky"]["saved_work"] == pytest.approx(0.4)
    assert summary["all"]["captures"] == 3
    assert summary["all"]["mean_loss_db"] == pytest.approx(0.02)


def test_a_report_holds_every_row_a_chart_and_a_table(bundle: Bundle, tmp_path: Path) -> None:
    lines = write_report(ROWS, bundle, tmp_path / "new")
    record = json.loads((tmp_path / "new" / "plan.json").read_text(encoding="utf-8"))
    assert record["bundle_sha256"] == bundle.sha256
    assert [ProofRow(**row) for row in record["rows"]] == ROWS
    assert record["summary"] == summarise(ROWS)
    assert {p.name for p in (tmp_path / "new").iterdir()} == {"plan.json", "plan.png", "plan.svg"}
    assert lines[2] == "| sky | 2 | 0.040 dB | 0.060 dB | 40% | 50% |"
    assert [line.split("|")[1].strip() for line in lines[2:]] == ["sky", "text", "all"]
