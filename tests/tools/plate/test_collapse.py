"""The two readers of the collapse trial: each against a slow, obvious reference."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.signal
import torch

from tools.plate import collapse
from tools.plate.collapse import (
    CLIPPED,
    HALF_PX,
    NOISE,
    SCENE_PX,
    SEEN_PX,
    TEXTURE,
    blind_loss,
    captures,
    lamp_of,
    linear_error,
    main,
    scenes_of,
)

SIDE = 2 * HALF_PX + 1


def _psf(arm: float) -> torch.Tensor:
    """Give a point that writes a share of its light to a cross."""
    light = torch.zeros(SIDE, SIDE, dtype=torch.float64)
    cross = torch.zeros_like(light)
    cross[HALF_PX, HALF_PX - 50 : HALF_PX + 51] = 1
    cross[HALF_PX - 50 : HALF_PX + 51, HALF_PX] = 1
    light[HALF_PX, HALF_PX] = 1 - arm
    return light + arm * cross / cross.sum()


def test_the_expected_error_is_that_of_lamps_that_are_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(collapse, "SEEN_PX", 12)
    lamp, psf = lamp_of(3), _psf(0.06)
    carried = psf.flatten()[lamp.index]
    rng = np.random.default_rng(0)
    sites = len(lamp.prior)
    drawn = np.linalg.cholesky(lamp.prior.numpy()) @ rng.standard_normal((sites, 2000))
    spread = np.hypot(TEXTURE, NOISE)
    seen = carried.numpy() @ drawn + spread * rng.standard_normal((len(carried), 2000))
    gain = lamp.prior.numpy() @ carried.numpy().T
    whole = carried.numpy() @ gain
    whole[np.diag_indices_from(whole)] += spread**2
    found = gain @ np.linalg.solve(whole, seen)
    of_lamp = np.mean((found - drawn) ** 2)
    total = float(linear_error(psf, (lamp,)))
    # but for what the lamps leave beside them, and the picture's own error
    assert CLIPPED * of_lamp < total < 1.3 * CLIPPED * of_lamp


def test_a_cross_tells_more_of_a_lamp_than_a_point() -> None:
    lamps = (lamp_of(3), lamp_of(8))
    errors = [float(linear_error(_psf(arm), lamps)) for arm in (0.0, 0.02, 0.06)]
    assert errors[0] > 2 * errors[1] > 2 * errors[2]


def test_a_point_is_the_best_for_a_blind_reader() -> None:
    scenes = scenes_of(2, 1)
    losses = [float(blind_loss(_psf(arm), scenes)) for arm in (0.0, 0.02, 0.06)]
    assert losses == sorted(losses)


def test_captures_are_blurred_and_clipped_scenes() -> None:
    scenes, psf = scenes_of(1, 2), _psf(0.06)
    assert scenes.shape == (1, SCENE_PX, SCENE_PX)
    assert CLIPPED <= float((scenes > 1).double().mean()) < 2 * CLIPPED
    again = scipy.signal.fftconvolve(scenes[0].numpy(), psf.numpy(), mode="same")
    np.testing.assert_allclose(captures(psf, scenes)[0], again.clip(1e-6, 1), atol=1e-9)


def test_sites_are_carried_to_what_is_seen() -> None:
    lamp = lamp_of(3)
    seen, sites = lamp.index.shape
    assert sites == 29
    whole = (2 * SEEN_PX + 1) ** 2
    clipped = sum(y * y + x * x <= 25 for y in range(-5, 6) for x in range(-5, 6))
    assert seen == whole - clipped
    assert int(lamp.index.min()) >= 0
    assert int(lamp.index.max()) < SIDE**2


def test_the_command_writes_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(collapse, "RADII_PX", (2,))
    main(["--out-dir", str(tmp_path), "--cells", "288", "--steps", "1"])
    told = json.loads((tmp_path / "collapse.json").read_text("utf-8"))
    assert len(told["rows"]) == 7
    assert told["rows"]["bare lens"]["core_share"] == 1
    assert "eq. 5.12" in capsys.readouterr().out
