"""A pinhole between its two limits: its own shadow, and the rings of Airy."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.pinhole import Pinhole
from camkit.models_def.optics.freezable_optics import radial_layout


def _light(hole: Pinhole, wave_um: float, side_px: int, **places: float) -> NDArray[np.float64]:
    traced = hole.kernels(
        radial_layout(np.array([places.get("height_mm", 0.0)])),
        np.array([wave_um]),
        depth_mm=places.get("depth_mm", math.inf),
        side_px=side_px,
        pitch_um=places.get("pitch_um", 6.0),
    )
    return np.asarray(traced.kernels[0, 0].numpy() * float(traced.energy_kept))


def _half_width(line: NDArray[np.float64]) -> float:
    """Give the full width at half of the middle, linear between pixels."""
    side = line[line.size // 2 :] / line[line.size // 2]
    first = int(np.argmax(side < 0.5))
    return float(2 * (first - 1 + (side[first - 1] - 0.5) / (side[first - 1] - side[first])))


def test_a_narrow_hole_shows_the_disc_of_airy() -> None:
    hole = Pinhole(diameter_mm=0.1, distance_mm=43.0)
    light = _light(hole, 0.55, 201)
    # 1.029 wavelengths over the aperture number (Born and Wolf, 8.5.2)
    told = 1.029 * 0.55e-3 * 43.0 / 0.1 / 6e-3
    assert _half_width(light[100]) == pytest.approx(told, rel=0.02)


def test_a_wide_hole_shows_its_shadow() -> None:
    hole = Pinhole(diameter_mm=0.74, distance_mm=5.0)
    light = _light(hole, 0.45, 201)
    shadow_px = 0.74 / 6e-3
    offset = np.arange(201) - 100
    inside = np.hypot(offset[:, None], offset) < shadow_px / 2
    assert light[inside].sum() > 0.97
    # the mean square of a disc's radius is half the square of its radius
    square = (light * (offset[:, None] ** 2 + offset**2))[np.hypot(offset[:, None], offset) < 85]
    assert np.sqrt(2 * square.sum()) == pytest.approx(shadow_px / 2, rel=0.02)


def test_light_is_kept() -> None:
    light = _light(Pinhole(diameter_mm=0.4, distance_mm=20.0), 0.55, 201)
    assert light.sum() == pytest.approx(1, abs=0.01)


def test_a_near_point_throws_a_wider_shadow() -> None:
    hole = Pinhole(diameter_mm=0.6, distance_mm=10.0)
    offset = np.arange(301) - 150

    def spread(depth_mm: float) -> float:
        light = _light(hole, 0.45, 301, depth_mm=depth_mm)
        near = np.hypot(offset[:, None], offset) < 140
        return float(np.sqrt((light * offset**2)[near].sum() / light[near].sum()))

    # twice as wide from as far before the hole as the sensor lies behind it
    assert spread(10.0) / spread(math.inf) == pytest.approx(2, rel=0.03)


def test_rings_stretch_along_the_meridian_off_the_axis() -> None:
    hole = Pinhole(diameter_mm=0.1, distance_mm=20.0)
    light = _light(hole, 0.55, 201, height_mm=20 * math.tan(math.radians(35)))
    along, across = _half_width(light[:, 100]), _half_width(light[100])
    assert along / across == pytest.approx(1 / math.cos(math.radians(35)) ** 2, rel=0.03)


def test_corners_are_darker_by_cos_to_the_fourth() -> None:
    hole = Pinhole(diameter_mm=0.5, distance_mm=10.0)
    assert hole.illumination(radial_layout(np.array([0.0, 10.0]))).tolist() == pytest.approx(
        [1, 0.25]
    )
    assert hole.distortion(10.0, 3).coefficients.shape == (3, 4)
    assert hole.copies(3, 0) == (hole,)


def test_what_is_no_hole_is_refused() -> None:
    with pytest.raises(ContractError, match="> 0 mm"):
        Pinhole(diameter_mm=0.0, distance_mm=43.0)
    with pytest.raises(ContractError, match="use another hole"):
        _light(Pinhole(diameter_mm=40.0, distance_mm=1.0), 0.55, 201)
