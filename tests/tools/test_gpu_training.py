"""A training is packed, gone on with where neither onnx nor camkit is, and packed again."""

import os
import subprocess
import sys
import tarfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.training.checkpoint import read_checkpoint
from tests.bayer_recipe import RECIPE
from tools import gpu_training

SMALL = {
    "width_px = 600": "width_px = 1600",
    "height_px = 400": "height_px = 1200",
    'prescription = "duet"': 'prescription = "duet"\ncopies = 1\nfields = 3\nkernel_px = 65\n'
    "rays = 512",
    # of a size that no bundle holds: random weights
    "[networks.S]": "[networks.Q]",
}
ALONE = (
    "import sys, runpy\n"
    "sys.modules['onnx'] = sys.modules['onnxruntime'] = None\n"
    "runpy.run_module('tools.gpu_training', run_name='__main__', alter_sys=True)\n"
)


@pytest.fixture
def words(tmp_path: Path) -> tuple[str, ...]:
    text = RECIPE
    for old, new in SMALL.items():
        text = text.replace(old, new)
    (tmp_path / "tiny.toml").write_text(text, encoding="utf-8")
    for name, count in (("sharp", 3), ("chosen", 1)):
        (tmp_path / name).mkdir()
        for number in range(count):
            noise = np.random.default_rng(number).integers(0, 255, (160, 192, 3), np.uint8)
            cv2.imwrite(str(tmp_path / name / f"{number}.png"), noise)
    folders = ("--data", f"{tmp_path}/sharp", "--valid", f"{tmp_path}/chosen")
    return (
        *("--recipe", f"{tmp_path}/tiny.toml", *folders, "--sizes", "Q"),
        *("--cache-dir", f"{tmp_path}/cache"),
    )


def _session(archive: Path, there: Path, out: Path) -> list[str]:
    """Unpack a session and give the arguments of its run."""
    with tarfile.open(archive) as packed:
        packed.extractall(there, filter="fully_trusted")
    words = ("go", str(there / "job"), str(out), "--sizes", "Q", "--device", "cpu")
    return [*words, "--workers", "0", "--minutes", "0.02", "--all-minutes", "60"]


def test_a_session_goes_on_where_the_one_before_ended(
    words: tuple[str, ...], tmp_path: Path
) -> None:
    archive = tmp_path / "training.tgz"
    gpu_training.main(["pack", str(archive), *words])
    there = tmp_path / "first"
    session = [sys.executable, "-c", ALONE, *_session(archive, there, tmp_path / "out")]
    subprocess.run(session, cwd=there, env={**os.environ, "PYTHONPATH": str(there)}, check=True)
    saved = read_checkpoint(tmp_path / "out" / "tiny_Q.pt")
    assert saved.training_data.startswith("3 photographs of pictures")
    gpu_training.main(["pack", str(archive), *words, "--checkpoints", str(tmp_path / "out")])
    gpu_training.main(_session(archive, tmp_path / "second", tmp_path / "out2"))
    later = read_checkpoint(tmp_path / "out2" / "tiny_Q.pt")
    assert later.step >= saved.step
    assert later.elapsed_s > saved.elapsed_s
    assert later.bank_digest == saved.bank_digest
    # what comes back holds no samples and no kernels
    kept = {p.name for p in (tmp_path / "out2").iterdir() if not p.is_symlink()}
    assert kept == {"tiny_Q.pt", "tiny_Q.jsonl"}


def test_an_archive_of_too_many_bytes_is_refused(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gpu_training, "MOST_BYTES", 1000)
    with pytest.raises(ContractError, match="over 1000"):
        gpu_training.main(["pack", str(tmp_path / "training.tgz"), *words])


def test_pictures_are_chosen_evenly_where_not_all_may_be_carried(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "README.md").write_text("licences")
    for number in range(8):
        (source / f"{number}.jpg").write_bytes(bytes(100))
    gpu_training._copy_pictures(source, tmp_path / "some", 400)
    kept = sorted(p.name for p in (tmp_path / "some").iterdir())
    assert kept == ["1.jpg", "3.jpg", "5.jpg", "7.jpg", "README.md"]
