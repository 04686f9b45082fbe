import math
from typing import Any

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Bench


def test_the_sensor_stands_where_the_focus_is_sharp() -> None:
    bench = Bench(diameter_mm=9.16, focal_length_mm=50, focus_mm=5000)
    assert bench.distance_mm == pytest.approx(50.505050505)
    r2 = torch.linspace(0, 4.58, 50, dtype=torch.float64) ** 2
    waves = bench.path_mm(r2, 5000) / 0.55e-3
    assert float(waves.abs().max()) < 0.05, "a lens for infinity, used at 5 m"
    parabolic = Bench(
        diameter_mm=9.16,
        focal_length_mm=50,
        focus_mm=5000,
        lens_phase="parabolic",
        kernel="parabolic",
    )
    assert float(parabolic.path_mm(r2, 5000).abs().max()) < 1e-15


def test_paths_are_those_of_spheres() -> None:
    bench = Bench(diameter_mm=2, sensor_mm=7.0)
    r2 = torch.tensor([0.0, 0.25, 1.0], dtype=torch.float64)
    expected = [math.sqrt(r + 9) - 3 + math.sqrt(r + 49) - 7 for r in r2.tolist()]
    assert bench.path_mm(r2, 3.0).tolist() == pytest.approx(expected, abs=1e-14)
    assert bench.steepest(3.0) == pytest.approx(1 / math.sqrt(10) + 1 / math.sqrt(50))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"lens_phase": "exact", "kernel": "parabolic"}, "spherical aberration"),
        ({"lens_phase": "parabolic", "kernel": "exact"}, "spherical aberration"),
        ({"lens_phase": "round"}, "one of exact, parabolic"),
        ({"aperture": "star"}, "one of circle, square"),
        ({"diameter_mm": 0.0}, "must be > 0"),
        ({"diameter_mm": math.nan}, "must be > 0"),
        ({"focus_mm": 40.0}, "farther away than its focal length"),
        ({"sensor_mm": 50.0}, "not with one"),
        ({"focal_length_mm": math.inf}, "state sensor_mm"),
        ({"focal_length_mm": math.inf, "sensor_mm": -1.0}, "sensor_mm must be > 0"),
    ],
)
def test_what_is_no_camera_is_refused(wrong: dict[str, Any], message: str) -> None:
    right: dict[str, Any] = {"diameter_mm": 10.0, "focal_length_mm": 50.0, "focus_mm": 5000.0}
    with pytest.raises(ContractError, match=message):
        Bench(**{**right, **wrong})
