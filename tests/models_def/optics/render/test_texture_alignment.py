from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.texture_alignment import (
    Alignment,
    align_reference,
    averaged,
    finer,
    fit_alignment,
    scene_radius_mm,
)
from camkit.models_def.optics.render.window import Window, corner_window
from camkit.models_def.optics.spot import slopes_for_heights
from camkit.radial import RadialDistortion
from tests.models_def.optics.render.centred import centred_window

# of a pixel of 6 um, over the whole field of the duet
FIT_PX = 0.1


def _linear(magnification: float) -> Alignment:
    rows = np.tile([magnification, 0.0, 0.0, 0.0], (3, 1))
    return Alignment(
        distortion=RadialDistortion(coefficients=rows, radius_mm=2.0), scene_scale=20.0
    )


def test_chief_rays_come_from_where_the_alignment_says(near_duet: Lens) -> None:
    """Also between the 16 heights of the fit."""
    window = corner_window(2500, 2500, 6.0)
    alignment = fit_alignment(near_duet, window)
    heights = np.linspace(0.5, window.radius_mm, 11)
    exact = slopes_for_heights(near_duet, torch.from_numpy(heights)).numpy() * 1000.0
    missed_by = (scene_radius_mm(alignment, heights) / exact - 1) * heights
    assert np.abs(missed_by).max() < FIT_PX * window.pitch_mm


def test_alignment_inverts_its_polynomial() -> None:
    rows = np.tile([1.02, -0.05, 0.01, 0.002], (3, 1))
    alignment = Alignment(
        distortion=RadialDistortion(coefficients=rows, radius_mm=4.0), scene_scale=20.0
    )
    r = np.linspace(0, 1, 11)
    heights = 4.0 * (1.02 * r - 0.05 * r**3 + 0.01 * r**5 + 0.002 * r**7)
    assert scene_radius_mm(alignment, heights) == pytest.approx(4.0 * 20.0 * r, abs=1e-7)


def test_a_fold_is_refused() -> None:
    rows = np.tile([1.0, -1.0, 0.0, 0.0], (3, 1))
    folded = Alignment(
        distortion=RadialDistortion(coefficients=rows, radius_mm=4.0), scene_scale=20.0
    )
    with pytest.raises(ContractError, match="fold"):
        scene_radius_mm(folded, np.array([3.9]))


def test_a_picture_of_matching_scale_is_aligned_sample_by_sample() -> None:
    window = centred_window(5, 7, 10.0)
    values = torch.rand(3, 5, 7, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    texture = Texture(values=values, pitch_mm=0.01 / 0.5 * 20, axis_px=(2.0, 3.0))
    aligned = align_reference(texture, _linear(0.5), window)
    assert float((aligned - values).abs().max()) < 1e-9


def test_oversampling_averages_over_the_pixel() -> None:
    """A ramp of twice the scale: each pixel holds two samples' worth of it."""
    window = centred_window(2, 2, 10.0)
    ramp = torch.arange(8, dtype=torch.float64).expand(3, 8, 8)
    texture = Texture(values=ramp, pitch_mm=0.005 * 20, axis_px=(3.5, 3.5))
    aligned = align_reference(texture, _linear(1.0), window, oversample=4)
    expected = torch.tensor([2.5, 4.5], dtype=torch.float64).expand(3, 2, 2)
    assert float((aligned - expected).abs().max()) < 1e-9


def test_a_finer_window_covers_the_same_pixels() -> None:
    window = Window(height_px=3, width_px=4, pitch_um=6.0, top_mm=1.0, left_mm=-2.0)
    fine = finer(window, 3, margin_px=2)
    ys, xs = fine.centres_mm()
    assert (len(ys), len(xs)) == (3 * 3 + 4, 4 * 3 + 4)
    inner = ys[2:-2].reshape(3, 3).mean(1)
    assert torch.allclose(inner, window.centres_mm()[0])


def test_averages_are_block_means() -> None:
    planes = torch.arange(3 * 4 * 4, dtype=torch.float64).reshape(3, 4, 4)
    assert float(averaged(planes, 2)[1, 1, 0]) == float(planes[1, 2:4, 0:2].mean())


def test_alignment_needs_a_plane_at_a_finite_distance(near_duet: Lens) -> None:
    far = replace(near_duet, object_distance_mm=float("inf"))
    with pytest.raises(ContractError, match="finite"):
        fit_alignment(far, centred_window(3, 3, 6.0))
    texture = Texture(values=torch.zeros(3, 2, 2), pitch_mm=1.0, axis_px=(0.0, 0.0))
    with pytest.raises(ContractError, match="oversample"):
        align_reference(texture, _linear(1.0), centred_window(3, 3, 6.0), oversample=0)
