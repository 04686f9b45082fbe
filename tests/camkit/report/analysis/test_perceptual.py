"""The perceptual substitute: 0 for equal pictures, near 1 where one alone has an edge."""

from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.report.analysis.perceptual import CONSTANT, looks_different, vgg_measure


def _edge(height: float, side: int = 64) -> FloatArray:
    picture = np.full((3, side, side), 0.2, np.float32)
    picture[:, :, side // 2 :] += np.float32(height)
    return picture


def test_equal_pictures_look_the_same() -> None:
    noise = np.random.default_rng(0).random((3, 48, 40), np.float32)
    assert looks_different(noise, noise).max() == pytest.approx(0, abs=1e-12)


def test_an_edge_of_one_picture_alone_is_the_formula_of_its_height() -> None:
    """Prewitt gives a third of the height three times; the other picture has none."""
    apart = looks_different(_edge(0.5), _edge(0.0))
    told = 1 - CONSTANT / (0.5**2 + CONSTANT)
    assert apart.max() == pytest.approx(told, rel=0.02)
    assert apart[:, :20].max() < 0.01


def test_brightness_alone_is_no_edge() -> None:
    brighter = _edge(0.3) + np.float32(0.2)
    assert looks_different(_edge(0.3), brighter).max() == pytest.approx(0, abs=1e-6)


def test_weights_that_are_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError):
        vgg_measure(tmp_path / "none.safetensors")
