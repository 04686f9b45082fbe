"""Whatever a bundle holds, camkit does its work or refuses in one line, in bounded time and memory.

A case that fails is made again by its number: `python -m tests.hostile.child NUMBER 1`.
"""

import os
from pathlib import Path

import pytest

from tests.hostile.bases import bases
from tests.hostile.generator import hostile_bundle, seeded_decisions, sound_bundle
from tests.hostile.runner import MOST_SECONDS, try_seeds
from tests.hostile.trial import FaultError, try_bundle
from tests.toy_camera.install import toy_installed  # noqa: F401

CASES = int(os.environ.get("HOSTILE_CASES", "1000"))
FIRST = int(os.environ.get("HOSTILE_FIRST", "0"))


def test_the_same_decisions_give_the_same_bundle() -> None:
    made = [hostile_bundle(seeded_decisions(seed)) for seed in range(40)]
    assert made == [hostile_bundle(seeded_decisions(seed)) for seed in range(40)]
    assert len(set(made)) > 30


@pytest.mark.usefixtures("toy_installed")
def test_the_bundles_they_are_made_of_are_sound(tmp_path: Path) -> None:
    for number in range(len(bases())):
        path = tmp_path / f"{number}.camkit"
        path.write_bytes(sound_bundle(number))
        assert try_bundle(path) == "processed"


def test_a_fault_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sound.camkit"
    path.write_bytes(sound_bundle(0))
    monkeypatch.setattr("tests.hostile.trial.process", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        try_bundle(path)
    path.write_bytes(b"")
    monkeypatch.setattr("tests.hostile.trial.MOST_LINE", 3)
    with pytest.raises(FaultError, match="no single line"):
        try_bundle(path)


@pytest.mark.slow
@pytest.mark.timeout(CASES * MOST_SECONDS)
def test_a_thousand_hostile_bundles_end_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = try_seeds(FIRST, CASES)
    with capsys.disabled():
        print("\n" + outcome.line())
    assert not outcome.faults, "\n".join(f"{seed}: {what}" for seed, what in outcome.faults.items())
    assert sum(outcome.ends.values()) == CASES
    assert min(outcome.ends[end] for end in ("refused", "not proved", "processed")) > CASES // 50
