import contextlib
from pathlib import Path
from typing import Any

import pytest

from camkit.errors import CamkitError, ContractError
from camkit.runtime.calibration.lensfun.camera import slug
from camkit.runtime.calibration.lensfun.database import LEAST, MOST
from camkit.runtime.calibration.lensfun.ordinary import CameraOptions, lensfun_bundle
from tests.lensfun_factory import ZOOM, write_database, write_shot


def test_without_a_name_the_bundle_has_that_of_the_lens(tmp_path: Path) -> None:
    shot, database = write_shot(tmp_path / "shot.dng"), write_database(tmp_path)
    made = lensfun_bundle(database, ZOOM, shot, CameraOptions(focal_mm=24.0))
    assert made.manifest.name == slug(ZOOM)
    assert any("in the database" in note for note in made.notes)


@pytest.mark.parametrize(
    "wrong",
    [
        {"focal_mm": 0.0},
        {"focal_mm": float("nan")},
        {"focal_mm": 24.0, "aperture": -1.0},
        {"focal_mm": 24.0, "distance_m": 0.0},
        {"focal_mm": 24.0, "crop_factor": float("inf")},
        {"focal_mm": 24.0, "scale": 0.0},
        {"focal_mm": 24.0, "scale": 1e9},
        {"focal_mm": 24.0, "aperture": 1e-300},
        {"focal_mm": 24.0, "distance_m": 1e-300},
    ],
)
def test_options_that_no_camera_has_are_named(wrong: dict[str, Any]) -> None:
    with pytest.raises(ContractError, match=f"{list(wrong)[-1]} must be > 0"):
        CameraOptions(**wrong)


@pytest.mark.parametrize("option", ["focal_mm", "aperture", "distance_m", "crop_factor", "scale"])
@pytest.mark.parametrize("value", [LEAST, MOST])
def test_the_ends_of_what_options_may_be_are_taken_or_refused_in_words(
    tmp_path: Path, option: str, value: float
) -> None:
    options = CameraOptions(**({"focal_mm": 24.0} | {option: value}))
    shot, database = write_shot(tmp_path / "shot.dng"), write_database(tmp_path)
    with contextlib.suppress(CamkitError):
        lensfun_bundle(database, ZOOM, shot, options)
