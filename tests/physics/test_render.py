"""What light does, whatever the renderer: energy, pinholes, points, convergence."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from camkit.models_def.optics.kernel_bank import (
    ChannelResponse,
    gaussian_response,
    wavelength_grid,
)
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.paraxial import paraxial_image, with_paraxial_focus
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import trace_psf, with_object_distance
from camkit.models_def.optics.render.lens_view import Optics, lens_optics
from camkit.models_def.optics.render.monte_carlo import Sampling, render
from camkit.models_def.optics.render.psf_map import MapGrid, render_by_map, trace_map
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.texture_alignment import averaged, fit_alignment
from camkit.models_def.optics.spot import slopes_for_heights
from camkit.models_def.optics.trace import Rays, SurfaceTensors, trace
from camkit.scenes import procedural_scene
from tests.models_def.optics.render.centred import centred_window

DUET = Path(__file__).parents[2] / "models_def" / "prescriptions" / "duet.toml"
GREEN = ChannelResponse(wavelengths_um=np.array([0.54]), response=np.ones((3, 1)), source="test")
EVEN = Texture(values=torch.ones(3, 2, 2), pitch_mm=1.0, axis_px=(0.0, 0.0))


@pytest.fixture(scope="module")
def duet() -> Lens:
    return with_paraxial_focus(with_object_distance(read_lens(DUET), 1000.0))


def _hole(radius_mm: float, distance_mm: float) -> Optics:
    """A round hole in front of the sensor."""

    def tensors(wavelengths_um: Tensor) -> SurfaceTensors:
        flat = torch.zeros(1, dtype=torch.float64)
        return SurfaceTensors(
            curvature_per_mm=flat,
            conic=flat,
            even_asphere=torch.zeros(1, 0, dtype=torch.float64),
            thickness_mm=flat + distance_mm,
            semi_diameter_mm=flat + math.inf,
            index=torch.ones(2, *wavelengths_um.shape, dtype=torch.float64),
            aspheric=(False,),
        )

    return Optics(
        tensors=tensors,
        stop=0,
        stop_radius_mm=radius_mm,
        object_distance_mm=100.0,
        reference_wavelength_um=0.54,
    )


def _disc_light(height_mm: float, radius_mm: float, distance_mm: float) -> float:
    """Give E / (pi L) of a disc of radiance L on an element off its axis.

    References: Foote 1915; the form factor of a disc and a parallel element.
    """
    field, half = (height_mm / distance_mm) ** 2, (radius_mm / distance_mm) ** 2
    root = math.sqrt((1 + field + half) ** 2 - 4 * field * half)
    return 0.5 * (1 - (1 + field - half) / root)


def test_a_hole_lights_the_sensor_by_the_form_factor_of_a_disc() -> None:
    """Closed form, wide open (F/2.5), up to 37 degrees; cos^4 is its limit for a small hole."""
    optics = _hole(4.0, 20.0)
    for height in (0.0, 6.0, 15.0):
        window = replace(centred_window(8, 8, 1.0), top_mm=height)
        picture = render(
            EVEN, optics, GREEN, window, Sampling(spp=64, passes=4, illumination="kept")
        )
        expected = _disc_light(height, 4.0, 20.0) / _disc_light(0.0, 4.0, 20.0)
        # 49 k rays, of which some 90 % pass: 0.15 % of noise at most
        assert float(picture.mean()) == pytest.approx(expected, rel=4e-3)


def _forward_light(lens: Lens, heights_mm: tuple[float, ...]) -> list[float]:
    """Send rays of equal radiance through the stop and count what lands in rings."""
    optics, count, widest = lens_optics(lens), 1_500_000, 0.5
    random = torch.rand(4, count, generator=torch.Generator().manual_seed(7))
    reach = optics.stop_radius_mm * random[0].sqrt()
    x, y = reach * torch.cos(2 * math.pi * random[1]), reach * torch.sin(2 * math.pi * random[1])
    tilt = widest * random[2].sqrt()
    p, q = tilt * torch.cos(2 * math.pi * random[3]), tilt * torch.sin(2 * math.pi * random[3])
    n = torch.rsqrt(1 + p**2 + q**2)
    start = Rays(x=x, y=y, z=0 * x, l=p * n, m=q * n, n=n, fate=torch.zeros(count).to(torch.int8))
    landed = trace(optics.stopped(torch.tensor(0.54)).converted(torch.float32), start)
    height, light = torch.hypot(landed.x, landed.y), torch.where(landed.valid, n**4, 0.0)
    rings = []
    for middle in heights_mm:
        inside = (height - middle).abs() < 1
        rings.append(float(light[inside].sum()) / (4 * middle))
    return rings


def test_an_even_scene_gives_the_relative_illumination(duet: Lens) -> None:
    """Backward from pixels as forward through the stop: no light is lost or made."""
    heights = (5.0, 20.0)
    forward = _forward_light(duet, heights)
    backward = []
    for height in heights:
        window = replace(centred_window(16, 16, 1.0), top_mm=height)
        picture = render(
            EVEN, lens_optics(duet), GREEN, window, Sampling(passes=2, illumination="kept")
        )
        backward.append(float(picture.mean()))
    # the rings hold 40 and 170 k rays: 0.6 % of noise
    assert backward[1] / backward[0] == pytest.approx(forward[1] / forward[0], rel=0.015)


def test_a_pinhole_renders_the_texture_through_the_box_of_a_pixel() -> None:
    """Sample on pixel, bilinear: the box gives the weights 1/8, 3/4, 1/8 of each direction."""
    optics = _hole(1e-4, 50.0)
    window = centred_window(16, 12, 6.0)
    values = torch.rand(3, 16, 12, generator=torch.Generator().manual_seed(1))
    texture = Texture(values=values, pitch_mm=0.012, axis_px=(7.5, 5.5))
    picture = render(texture, optics, GREEN, window, Sampling(spp=256, passes=4))
    weights = torch.tensor([1 / 8, 3 / 4, 1 / 8])
    stencil = (weights[:, None] * weights).expand(3, 1, 3, 3)
    expected = torch.nn.functional.conv2d(values, stencil, groups=3)
    assert float((picture[:, 1:-1, 1:-1] - expected).abs().max()) < 0.01


def test_a_light_below_the_axis_is_recorded_above_it(duet: Lens) -> None:
    """The image is inverted; rows of sensor and texture both run along it."""
    window = centred_window(64, 64, 60.0)
    values = torch.zeros(3, 3, 3)
    values[:, 1, 1] = 1
    # the lamp hangs at y = -20 mm, x = +10 mm in the scene
    lamp = Texture(values=values, pitch_mm=2.0, axis_px=(1 - 20 / 2.0, 1 + 10 / 2.0))
    picture = render(lamp, lens_optics(duet), GREEN, window, Sampling(spp=16, passes=1))
    row, column = divmod(int(picture[1].argmax()), 64)
    ys, xs = window.centres_mm()
    scale = -paraxial_image(duet).magnification
    assert float(ys[row]) == pytest.approx(20 * scale, abs=0.08)
    assert float(xs[column]) == pytest.approx(-10 * scale, abs=0.08)


def _blurred(planes: Tensor, weights: list[float]) -> Tensor:
    """Convolve (1, h, w) with the same symmetric weights along both directions."""
    line = torch.tensor(weights, dtype=planes.dtype)
    square = (line[:, None] * line)[None, None] / line.sum() ** 2
    return torch.nn.functional.conv2d(planes[None], square, padding="same")[0]


def test_a_point_of_light_is_rendered_as_the_traced_psf(duet: Lens) -> None:
    """At 10 mm from the axis, where coma is; the point is a tent of one pixel to each side."""
    height, pitch_mm, pixels, fine = 10.0, 0.012, 16, 8
    side = pixels * fine - 1
    heights = torch.tensor([height], dtype=torch.float64)
    green = torch.tensor([0.54], dtype=torch.float64)
    kernel = trace_psf(duet, heights, green, side, 12.0 / fine, rays=8000).kernels
    spread = _blurred(
        torch.nn.functional.pad(kernel[0], (0, 1, 0, 1)), [*range(1, 9), *range(7, 0, -1)]
    )
    expected = averaged(spread.expand(3, -1, -1), fine)[0]
    # the chief ray lies on the middle sample of the kernel
    shift = ((side - 1) / 2 - (fine - 1) / 2) / fine * pitch_mm
    window = replace(centred_window(pixels, pixels, 12.0), top_mm=height - shift, left_mm=-shift)
    step = torch.tensor([1e-6], dtype=torch.float64)
    near, far = slopes_for_heights(duet, heights), slopes_for_heights(duet, heights + step)
    values = torch.zeros(3, 3, 3)
    values[:, 1, 1] = 1
    # radial and azimuthal magnification differ by less than the noise: their mean serves
    spot_mm = pitch_mm * 500 * float((far - near) / step + near / heights)
    scene_y = -1000 * float(near)
    point = Texture(values=values, pitch_mm=spot_mm, axis_px=(1 + scene_y / spot_mm, 1.0))
    picture = render(point, lens_optics(duet), GREEN, window, Sampling(spp=256, passes=8)).mean(0)
    error = float((picture / picture.sum() - expected / expected.sum()).square().sum().sqrt())
    assert error < 0.06 * float((expected / expected.sum()).square().sum().sqrt())


def test_rays_converge_to_the_psf_map_as_the_root_of_their_number(duet: Lens) -> None:
    """Down to what separates the two: the map's kernels change in steps, its rays are few."""
    response = gaussian_response(wavelength_grid(9))
    window = replace(centred_window(16, 16, 6.0), top_mm=6.0, left_mm=4.0)
    scale = -paraxial_image(duet).magnification
    scene = torch.from_numpy(np.clip(procedural_scene(5, 96, 96), 0, 1)).contiguous()
    texture = Texture(
        values=scene,
        pitch_mm=2 * window.pitch_mm / scale,
        axis_px=tuple(43 - mm / (2 * window.pitch_mm) for mm in (6.0, 4.0)),  # type: ignore[arg-type]
    )
    grid = MapGrid(
        depths_mm=np.array([1000.0]),
        field_heights_mm=np.array([0.0, 6.0, 7.0, 8.0]),
        wavelengths_um=wavelength_grid(9),
        kernel_px=97,
        pitch_um=3.0,
    )
    traced = trace_map(duet, response, grid)
    mapped = render_by_map(texture, fit_alignment(duet, window), traced, window, step_px=10)

    def error(passes: int) -> float:
        picture = render(
            texture, lens_optics(duet), response, window, Sampling(spp=16, passes=passes)
        )
        return float((picture - mapped).square().mean().sqrt())

    few, many = error(2), error(32)
    assert few / many == pytest.approx(4, rel=0.15)
    assert many < 0.01
