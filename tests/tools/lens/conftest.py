"""Tiny optics with and without a haze, and pictures, for the tools of the thin plate."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.haze_file import write_haze
from camkit.bundle.psf_file import write_psf
from tests.bundle_factory import tiny_psf
from tests.haze_factory import tiny_haze


@pytest.fixture
def hazy(tmp_path: Path) -> str:
    """Give optics with a haze, as `camkit analyse field` is told of them."""
    psf = tiny_psf(pitch_um=5.96)
    write_psf(tmp_path / "psf.safetensors", psf)
    write_haze(tmp_path / "haze.safetensors", tiny_haze(psf))
    return f"{tmp_path / 'psf.safetensors'}+{tmp_path / 'haze.safetensors'}"


@pytest.fixture
def clear(tmp_path: Path) -> str:
    """Give the same optics without the haze."""
    write_psf(tmp_path / "clear.safetensors", tiny_psf(pitch_um=5.96))
    return str(tmp_path / "clear.safetensors")


@pytest.fixture
def picture(tmp_path: Path) -> Callable[[str], Path]:
    """Give what writes a picture of blocks."""

    def write(name: str) -> Path:
        path = tmp_path / f"{name}.png"
        blocks = np.random.default_rng(len(name)).integers(40, 220, (6, 8, 3), dtype=np.uint8)
        cv2.imwrite(str(path), cv2.resize(blocks, (96, 72), interpolation=0))
        return path

    return write
