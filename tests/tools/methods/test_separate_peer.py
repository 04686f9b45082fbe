"""A process of another environment restores parts; one that ends is told of."""

import sys
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.quality import Shot
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle
from tools.comparison.peers import LocalCapture
from tools.comparison.photograph import photograph
from tools.methods import separate_peer
from tools.methods.separate_peer import SeparatePeer

DOUBLES = """
import sys
import numpy as np
while line := sys.stdin.buffer.readline():
    side, weight, step, rounds = map(float, line.split())
    size = 12 * int(side) ** 2
    part, kernels = (np.frombuffer(sys.stdin.buffer.read(size), np.float32) for _ in range(2))
    assert np.allclose(kernels.reshape(3, -1).sum(1), 1, atol=1e-3)
    sys.stdout.buffer.write((2 * part).tobytes() + np.float64(7).tobytes())
    sys.stdout.buffer.flush()
"""


@pytest.fixture
def capture(tmp_path: Path) -> LocalCapture:
    bundle = write_wide_bundle(tmp_path)
    shot = Shot(set_name="s", picture=Path("a"), number=0, position=0, iso=100.0, psf="bundle")
    return photograph(shot, texture(80, 96), bundle, bundle.frozen_optics).local


def peer(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> SeparatePeer:
    script = folder / "worker.py"
    script.write_text(text)
    monkeypatch.setattr(separate_peer, "deepinv_worker_path", lambda: str(script))
    return SeparatePeer(Path(sys.executable))


def test_parts_go_there_and_come_back(
    capture: LocalCapture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with peer(DOUBLES, tmp_path, monkeypatch) as one:
        restored = one.restore(capture)
    assert restored.shape == capture.planes.shape
    middle = np.s_[:, 30:50, 40:60]
    assert np.allclose(restored[middle], 2 * capture.planes[middle], atol=1e-5)
    assert one.cpu_s() > 7


def test_a_process_that_ends_or_is_not_there_is_told_of(
    capture: LocalCapture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = peer("import sys; sys.exit(3)", tmp_path, monkeypatch)
    with gone as one, pytest.raises(ContractError, match="has ended"):
        one.restore(capture)
    with pytest.raises(ContractError, match="cannot start"):
        SeparatePeer(tmp_path / "none")
