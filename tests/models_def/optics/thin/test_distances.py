"""A lens at other object distances: each as if it were frozen alone, sharp where optics say."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.sensor import Extent
from camkit.errors import ContractError
from camkit.haze import Haze
from camkit.models_def.optics.thin import distances
from camkit.models_def.optics.thin.distances import freeze_distances
from camkit.models_def.optics.thin.hazy_freezing import HazyGrid, freeze_hazy
from camkit.models_def.optics.thin.middle import Middle
from tests.bundle_factory import tiny_sensor
from tests.thin_factory import perfect_lens

FOCUS_MM, DEFOCUS_MM = 40.0, 6.4
LENS = perfect_lens(FOCUS_MM, 3.0, defocus_mm=DEFOCUS_MM)
SHARP_MM = FOCUS_MM * (FOCUS_MM + DEFOCUS_MM) / DEFOCUS_MM
"""Where 1 / focus = 1 / object + 1 / image."""
SENSOR = tiny_sensor().model_copy(
    update={"extent": Extent(width_px=96, height_px=64, pixel_pitch_um=60.0)}
)
FEW = HazyGrid(fields=3, wavelengths=2, core_px=6, cell_px=4, rays=1000)


def _haze(optics: FrozenOptics) -> Haze:
    assert optics.haze is not None
    return optics.haze


@pytest.fixture(scope="module")
def found() -> FrozenOptics:
    lines: list[str] = []
    distances = (SHARP_MM, 2 * SHARP_MM, math.inf)
    optics = freeze_distances(LENS, SENSOR, distances_mm=distances, tell=lines.append, grid=FEW)
    assert lines == [f"object at {d / 1000:g} m: kept" for d in distances[:2]]
    return optics


def test_an_object_where_the_lens_equation_says_is_sharp(found: FrozenOptics) -> None:
    haze = _haze(found)
    np.testing.assert_array_equal(haze.depths_mm, [SHARP_MM, 2 * SHARP_MM, math.inf])
    # the disc of the far point is 8 px in radius, and half as far in 1 / object is half as wide
    radii_px = np.array([0.0, 4.0, 8.0])
    inside_px = radii_px[:, None] * np.sqrt((np.arange(1000) + 0.5) / 1000)
    faded = np.clip((inside_px / 6 - 0.625) / 0.375, 0, 1)
    share = (0.5 + 0.5 * np.cos(np.pi * faded)).mean(axis=1)
    core = haze.core_share[0]
    light = core + haze.kernels[0].sum(axis=(-2, -1))
    np.testing.assert_allclose((core / light).mean(axis=-1), share, atol=0.03)


def test_every_distance_is_what_it_is_alone(found: FrozenOptics) -> None:
    haze = _haze(found)
    for index, distance_mm in enumerate(haze.depths_mm):
        lens = replace(LENS, object_distance_mm=float(distance_mm))
        alone, _ = freeze_hazy(lens, SENSOR, FEW)
        np.testing.assert_array_equal(found.psf.kernels[:, index], alone.psf.kernels[:, 0])
        around = (haze.kernels.shape[-1] - _haze(alone).kernels.shape[-1]) // 2
        middle = slice(around, haze.kernels.shape[-1] - around)
        np.testing.assert_array_equal(
            haze.kernels[:, index, :, middle, middle], _haze(alone).kernels[:, 0]
        )
        np.testing.assert_array_equal(haze.core_share[:, index], _haze(alone).core_share[:, 0])
        if math.isinf(distance_mm):
            np.testing.assert_array_equal(found.psf.field_heights_mm, alone.psf.field_heights_mm)


def test_no_other_distance_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ContractError, match="perfect is known at no other distance"):
        freeze_distances(LENS, SENSOR, distances_mm=(math.inf,), grid=FEW)
    abouts: Iterator[Middle] = iter(["peak", "chief ray"])
    real = freeze_hazy

    def other(*given, **chosen):  # type: ignore[no-untyped-def]
        optics, report = real(*given, **chosen)
        return optics, report | {"about": next(abouts)}

    def refused(lens, *given, **chosen):  # type: ignore[no-untyped-def]
        if lens.object_distance_mm == 500:
            raise ContractError("too wide")
        return real(lens, *given, **chosen)

    lines: list[str] = []
    monkeypatch.setattr(distances, "freeze_hazy", refused)
    kept = freeze_distances(LENS, SENSOR, distances_mm=(500.0, 580.0), tell=lines.append, grid=FEW)
    assert kept.psf.depths_mm.tolist() == [580.0, math.inf]
    assert lines == ["object at 0.5 m: left out, too wide", "object at 0.58 m: kept"]
    lines.clear()
    monkeypatch.setattr(distances, "freeze_hazy", other)
    with pytest.raises(ContractError, match="no other distance"):
        freeze_distances(LENS, SENSOR, distances_mm=(500.0,), tell=lines.append, grid=FEW)
    assert lines[0] == "object at 0.5 m: left out, by its chief ray"
