"""The constants of depth on the fine grid are found again, on a tiny array."""

import json
from pathlib import Path

import numpy as np
import pytest

from camkit.runtime.kinds.spad.finer.sigma import SigmaShares
from tests.spad_bundle import write_spad_bundle
from tools.spad import depth_sigma


def test_constants_are_fitted_and_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(depth_sigma, "LIGHTS", ((300.0, 3.0),))
    monkeypatch.setattr(depth_sigma, "SHARPER_LIGHTS", ((300.0, 3.0),))
    monkeypatch.setattr(depth_sigma, "SHARPERS", (1.0, 20.0))
    bundle = write_spad_bundle(tmp_path)
    out = tmp_path / "found" / "constants.json"
    depth_sigma.main(["--bundle", str(bundle.path), "--scenes", "1", "-o", str(out)])
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["sharper"]["mean_error_mm"][0]["20"] < found["sharper"]["mean_error_mm"][0]["1"]
    for way in ("linear", "network"):
        (quantile,) = found[way]["quantiles"]
        assert abs(np.log(quantile["best"])) <= abs(np.log(quantile["taken"])) + 1e-4


def test_shares_that_made_the_errors_are_found_again() -> None:
    rng = np.random.default_rng(0)
    truth = SigmaShares(noise=0.6, faint=40.0, slope=0.0, of_bin=0.1)
    errors: dict[tuple[float], depth_sigma.Errors] = {}
    for photons in (30.0, 100.0, 1000.0, 10_000.0):
        linear, slopes = rng.uniform(0.5, 2, (2, 20_000)) * 100 / np.sqrt(photons)
        sigma = truth.sigma_ps(linear, slopes, photons=photons, bin_ps=20.0)
        errors[(photons,)] = depth_sigma.Errors(
            photons=photons,
            errors_ps=np.abs(rng.normal(size=20_000) * sigma),
            linear_ps=linear,
            slopes_ps=slopes,
            bin_ps=20.0,
        )
    start = SigmaShares(noise=0.5, faint=10.0, of_bin=0.05)
    found = depth_sigma._fitted(errors, start, ("noise", "faint", "of_bin"))
    assert found["best"]["noise"] == pytest.approx(0.6, rel=0.05)
    assert found["best"]["faint"] == pytest.approx(40.0, rel=0.15)
    assert found["best"]["of_bin"] == pytest.approx(0.1, rel=0.05)
