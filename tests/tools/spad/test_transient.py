"""The pulse reaches the object first, then its mirror image; every way is told of."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.errors import ContractError
from tests.spad_bundle import write_spad_bundle
from tools.spad import transient
from tools.spad.mirror import MIRROR, mirrored, pixel_mm
from tools.spad.transient import main

SIZE = (64, 96)


def test_the_mirror_image_is_dimmer_and_later_than_the_object() -> None:
    sight = mirrored(SIZE, (100.0, 900.0))
    half = SIZE[1] // 2
    there = sight.albedo[:, :half] > 0
    np.testing.assert_allclose(
        sight.albedo[:, half:][:, ::-1][there], MIRROR * sight.albedo[:, :half][there]
    )
    assert (sight.times_ps[:, half:][:, ::-1] > sight.times_ps[:, :half])[there].all()


def test_the_pulse_is_seen_from_first_to_last() -> None:
    sight = mirrored(SIZE, (100.0, 900.0))
    seen = sight.times_ps[sight.albedo > 0]
    assert seen.min() == pytest.approx(100)
    assert seen.max() == pytest.approx(900)


def test_light_takes_its_time_from_one_sub_pixel_to_the_next() -> None:
    # times twice as long are of an object twice as large
    small, large = (pixel_mm(mirrored(SIZE, (0.0, span))) for span in (800.0, 1600.0))
    assert large == pytest.approx(2 * small)


def test_an_odd_width_has_no_middle() -> None:
    with pytest.raises(ContractError, match="even width; got 95"):
        mirrored((64, 95), (0.0, 1.0))


def test_every_way_is_told_of_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transient, "PHOTONS", (10_000.0,))
    bundle = write_spad_bundle(tmp_path)
    out = tmp_path / "out"
    assert main(["--bundle", str(bundle.path), "--out-dir", str(out)]) == 0
    record = json.loads((out / "transient.json").read_text(encoding="utf-8"))
    assert [row["method"] for row in record["rows"]] == ["net S", "linear", "bicubic"]
    assert record["apart_ps"] == 180
    assert cv2.imread(str(out / "transient.png")) is not None
    frames = cv2.VideoCapture(str(out / "transient.mp4")).get(cv2.CAP_PROP_FRAME_COUNT)
    assert frames == record["frames"]


def test_a_bundle_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="error: "):
        main(["--bundle", str(tmp_path / "none.camkit")])
