"""Cameras of physics alone: the haze undone where there is one, blocks as wide as kernels need."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.stages import Dehaze, Wiener
from camkit.report.analysis.physical import write_camera
from tests.bundle_factory import tiny_psf, tiny_sensor
from tests.haze_bundle import hazy_optics
from tests.haze_factory import CELL_PX


def test_the_haze_is_undone_before_the_bank(tmp_path: Path) -> None:
    manifest = write_camera(tmp_path / "a.camkit", "a", hazy_optics(), tiny_sensor()).manifest
    (dehaze,) = manifest.stages_of(Dehaze)
    (bank,) = manifest.stages_of(Wiener)
    assert dehaze.shrink == CELL_PX
    assert bank.takes[0] == dehaze.gives[0]


def test_without_a_haze_the_bank_takes_the_colours(tmp_path: Path) -> None:
    optics = FrozenOptics(psf=tiny_psf())
    manifest = write_camera(tmp_path / "a.camkit", "a", optics, tiny_sensor()).manifest
    assert manifest.stage(Dehaze) is None
    (bank,) = manifest.stages_of(Wiener)
    assert bank.takes == ("rgb", "unknown")
    assert (bank.block_px, bank.overlap_px) == (512, 160)


@pytest.mark.parametrize("side_px", [201, 203, 311])
def test_no_light_of_a_wide_kernel_comes_round_in_its_block(tmp_path: Path, side_px: int) -> None:
    psf = tiny_psf()
    more = (side_px - psf.kernels.shape[-1]) // 2
    beside = [(0, 0)] * (psf.kernels.ndim - 2) + [(more, more)] * 2
    optics = FrozenOptics(psf=replace(psf, kernels=np.pad(psf.kernels, beside)))
    manifest = write_camera(tmp_path / "a.camkit", "a", optics, tiny_sensor()).manifest
    (bank,) = manifest.stages_of(Wiener)
    assert bank.block_px >= 2 * side_px
    assert side_px // 2 <= bank.overlap_px <= bank.block_px // 2
