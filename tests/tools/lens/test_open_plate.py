"""tools/lens/open_plate.py on tiny frames: equal times, the stop's share of the light, lengths."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.models_def.optics.lens_file.lens_file import read_lens
from tests.bundle_factory import tiny_psf
from tests.haze_factory import tiny_haze
from tests.tiny_design import run_tool
from tools.lens import open_plate


def test_both_cameras_are_measured_for_equal_times(
    hazy: str,
    clear: str,
    picture: Callable[[str], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    psf = tiny_psf(pitch_um=5.96)
    made: list[float] = []

    def frozen(lens: Any, *_: object, **__: object) -> tuple[FrozenOptics, None]:
        made.append(lens.surfaces[0].thickness_mm)
        return FrozenOptics(psf=psf, haze=tiny_haze(psf)), None

    monkeypatch.setattr(open_plate, "freeze_hazy", frozen)
    out = tmp_path / "out"
    run_tool(
        monkeypatch,
        "lens.open_plate",
        *("--bundle", hazy, "--stop", clear, "--data", picture("a"), picture("bb")),
        *("--frame", 128, 96, "--times", 0.0625, 1, 4, "--stops-mm", 5, "-o", out),
    )
    told = json.loads((out / "open-plate.json").read_text("utf-8"))
    assert told["stop_light"] == pytest.approx(1 / 9, rel=0.03)
    assert told["length_mm"]["stop"] - told["length_mm"]["open"] == pytest.approx(15.6)
    assert made == [5]
    points = {(p["camera"], p["picture"], p["time"]): p for p in told["points"]}
    assert len(points) == 2 * 2 * 3
    for name in ("a.png", "bb.png"):
        # beyond full pixels time buys nothing; before, the stop is still short of light
        assert points["open", name, 4]["psnr_db"] == points["open", name, 1]["psnr_db"]
        assert points["stop", name, 1]["iso"] == pytest.approx(100 / told["stop_light"], rel=1e-3)
        assert points["stop", name, 4]["psnr_db"] > points["stop", name, 0.0625]["psnr_db"]
    lengths = {p["length_mm"] for p in told["by_length"]}
    assert lengths == {told["length_mm"]["open"], round(told["length_mm"]["open"] + 5, 2)}
    assert (out / "open-plate.png").stat().st_size > 10_000
    assert "| 0.0625 |" in capsys.readouterr().out


def test_a_stop_that_needs_twice_the_time_is_said_to() -> None:
    def point(camera: str, time: float, db: float) -> open_plate.Point:
        return open_plate.Point(
            camera=camera,
            length_mm=50.0,
            way="filter",
            picture="a",
            time=time,
            iso=100.0,
            pushed=1.0,
            psnr_db=db,
            rings_db=(db,),
        )

    opened = [point("open", time, db) for time, db in ((1, 20.0), (2, 23.0), (4, 40.0))]
    stopped = [point("stop", time, db) for time, db in ((1, 17.0), (2, 20.0), (4, 23.0))]
    waits = open_plate.waits([*opened, *stopped])
    assert waits == {"1": pytest.approx(2), "2": pytest.approx(2), "4": None}


def test_a_stop_is_moved_and_nothing_else() -> None:
    lens = read_lens(Path("thin-plate-stop"))
    moved = open_plate.with_stop_at(lens, 5.0)
    assert moved.surfaces[1:] == lens.surfaces[1:]
    assert open_plate.length_mm(lens) - open_plate.length_mm(moved) == pytest.approx(10.6)


def test_a_picture_that_is_not_there_is_refused_in_one_line(
    hazy: str, clear: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit, match="nowhere"):
        run_tool(
            monkeypatch,
            "lens.open_plate",
            *("--bundle", hazy, "--stop", clear, "--data", tmp_path / "nowhere.png"),
            *("-o", tmp_path / "out"),
        )
