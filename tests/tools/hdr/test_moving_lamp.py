"""A still bracket is better than a snapshot, one of lamps that moved is not."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from tests.hdr_bundle import write_hdr_bundle
from tests.planes_bundle import planes_sensor
from tests.tiny_design import run_tool
from tools.hdr import moving_lamp
from tools.hdr.moving_lamp import Case, draw_lamps, frames


@pytest.fixture
def bundle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bundle:
    monkeypatch.setattr(moving_lamp, "SIDE_PX", 176)
    return write_hdr_bundle(tmp_path)


def test_a_bracket_wins_while_lamps_stand_still_and_loses_when_they_move(
    bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    still, moving = Case(name="still"), Case(name="moving 8 px", step_px=8)
    monkeypatch.setattr(moving_lamp, "CASES", (still, moving))
    out = tmp_path / "found.json"
    run_tool(monkeypatch, "hdr.moving_lamp", "--bundle", bundle.path, "--seeds", 1, "-o", out)
    record = json.loads(out.read_text())
    means = record["means"]
    assert set(means["still"]) == {"input", "bracket", "physics"}
    assert means["still"]["bracket"]["hdr_psnr_db"] > means["still"]["physics"]["hdr_psnr_db"] + 3
    assert means["moving 8 px"]["physics"] == {**means["still"]["physics"], "wins": 1}
    assert means["moving 8 px"]["bracket"]["hdr_psnr_db"] < means["still"]["bracket"]["hdr_psnr_db"]
    assert means["moving 8 px"]["bracket"]["wins"] == 0
    assert "| moving 8 px |" in capsys.readouterr().out


def test_lamps_go_as_far_as_the_case_says_and_flash_frame_by_frame(bundle: Bundle) -> None:
    sensor = bundle.manifest.sensor
    first, second, third = frames(Case(name="moving", step_px=4), 1, sensor)
    lamp = max(draw_lamps(np.random.default_rng(1)), key=lambda one: max(one.colour))
    for number, scene in enumerate((first, second, third)):
        y = lamp.centre_px[0] + 4 * number * math.sin(lamp.angle_rad)
        x = lamp.centre_px[1] + 4 * number * math.cos(lamp.angle_rad)
        assert scene[:, round(y), round(x)].max() > 0.5 * max(lamp.colour)
    steady = frames(Case(name="still"), 1, sensor)
    np.testing.assert_array_equal(steady[0], first)
    np.testing.assert_array_equal(steady[0], steady[2])
    flashing = frames(Case(name="flashing", flashing=True), 1, sensor)
    states = {lamp.shines for lamp in draw_lamps(np.random.default_rng(1))}
    assert len(states) > 1
    assert not np.array_equal(flashing[0], flashing[1])


def test_lamps_cover_their_share_within_the_frame(bundle: Bundle) -> None:
    del bundle
    lamps = draw_lamps(np.random.default_rng(0))
    area = sum(math.pi * lamp.radius_px**2 for lamp in lamps)
    assert 0.015 * 176**2 <= area <= 0.015 * 176**2 + math.pi * 10**2
    assert all(32 < place < 144 for lamp in lamps for place in lamp.centre_px)


def test_a_camera_without_a_mosaic_is_refused(tmp_path: Path, bundle: Bundle) -> None:
    del bundle
    planes = write_hdr_bundle(tmp_path, "planes.camkit")
    manifest = planes.manifest.model_copy(update={"sensor": planes_sensor()})
    object.__setattr__(planes, "manifest", manifest)
    with pytest.raises(moving_lamp.UnsupportedError, match="has no mosaic"):
        moving_lamp.measure(Case(name="still"), 0, planes, ())
