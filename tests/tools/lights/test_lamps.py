"""Lamps of whole scenes: dark ones are counted, networks stand beside their front end."""

import sys

import numpy as np
import pytest

from tools.lights import lamps


def test_a_table_has_every_scene_and_their_mean(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(lamps, "SIZE_PX", (128, 160))
    monkeypatch.setattr(sys, "argv", ["lamps", "duet", "--scenes", "night:3", "night:5"])
    lamps.main()
    rows = [line.split("|") for line in capsys.readouterr().out.splitlines()[2:]]
    assert len(rows) == 2 * (2 * 2 + 2), "two sizes, networks and front end, scenes and means"
    for row in rows:
        network_or_front, half, fifth = row[2], float(row[3]), float(row[4])
        assert 0 <= fifth <= half <= 100, network_or_front
    means = {row[2].strip(): float(row[3]) for row in rows if "mean" in row[2]}
    assert means["M, mean"] <= means["front end of M, mean"] + 2


def test_dark_and_coloured_lamps_are_counted() -> None:
    truth = np.full((3, 4, 4), 0.1, np.float32)
    truth[:, 0, :] = 3.0
    picture = truth.copy()
    picture[:, 0, 0] = 0.3
    picture[1, 0, 1] = 0.1
    half, fifth, db = lamps.numbers_of(picture, truth)
    assert (half, fifth) == (50.0, 25.0)
    assert db < 20
    assert lamps.numbers_of(truth, truth)[:2] == (0.0, 0.0)
