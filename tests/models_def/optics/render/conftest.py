from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.models_def.optics.kernel_bank import (
    ChannelResponse,
    gaussian_response,
    wavelength_grid,
)
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.paraxial import paraxial_image, with_paraxial_focus
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.window import Window
from camkit.scenes import procedural_scene
from tests.models_def.optics.render.centred import centred_window

PRESCRIPTIONS = Path(__file__).parents[4] / "models_def" / "prescriptions"


@pytest.fixture
def near_duet() -> Lens:
    duet = read_lens(PRESCRIPTIONS / "duet.toml")
    return with_paraxial_focus(with_object_distance(duet, 1000.0))


@pytest.fixture
def response() -> ChannelResponse:
    return gaussian_response(wavelength_grid(9))


@pytest.fixture
def window() -> Window:
    """Off the axis, where coma and azimuth count."""
    return replace(centred_window(24, 20, 6.0), top_mm=8.0, left_mm=5.0)


@pytest.fixture
def texture(near_duet: Lens, window: Window) -> Texture:
    """A scene around the window, one sample to a pixel."""
    scale = -1 / paraxial_image(near_duet).magnification
    scene = np.clip(procedural_scene(3, 96, 96), 0, 1)
    return Texture(
        values=torch.from_numpy(scene).contiguous(),
        pitch_mm=window.pitch_mm * scale,
        axis_px=(36 - window.top_mm / window.pitch_mm, 36 - window.left_mm / window.pitch_mm),
    )
