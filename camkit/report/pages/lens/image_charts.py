"""Pictures of points over the field, and encircled energy."""

import math
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.point_image import encircled_airy
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import spot_diagram
from camkit.report.figure import Figure, Panel, chart, field_color, new_figure
from camkit.report.pages.lens.left_out import left_out_text, say_left_out
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.report.pages.lens.lens_image import LensImage
from camkit.units import UM_PER_MM, to_degrees

_CELLS: Final = 61
_CLOUD: Final = "fibonacci:8192"
_ROOM: Final = 1.3
_LEAST_AIRY: Final = 2.5
_GAMMA: Final = 0.5


@chart
def draw_psfs(facts: LensFacts) -> Figure:
    """Draw the image of a point of some fields to one scale; each to its own brightness."""
    numbers = facts.drawn_fields()
    image = facts.image
    assert image is not None
    figure = new_figure(max(2.4 * len(numbers), 5.2), 2.9)
    if numbers:
        panels = figure.subplots(1, len(numbers), sharey=True, squeeze=False)[0]
        half_mm = _half_mm(facts, image, numbers)
        for panel, field in zip(panels, numbers, strict=True):
            _draw_psf(panel, facts, image, field, half_mm)
        panels[0].set_ylabel("away from the axis, µm")
    say_left_out(figure, facts, "µm" if numbers else "")
    return figure


def _half_mm(facts: LensFacts, image: LensImage, numbers: list[int]) -> float:
    """Return half the width of all pictures: that of the widest image, but of two Airy radii."""
    airy = torch.where(torch.isfinite(facts.airy_mm), facts.airy_mm, 0.0)
    radii = [image.radius_mm(i, 0.9) for i in numbers]
    wide = max((radius for radius in radii if math.isfinite(radius)), default=0.0)
    return max(_ROOM * wide, _LEAST_AIRY * float(airy.max()), 1e-6)


def _draw_psf(panel: Panel, facts: LensFacts, image: LensImage, field: int, half_mm: float) -> None:
    image_here, half_um = image.images[field], half_mm * UM_PER_MM
    if image_here is None:
        light, sides_um = _ray_light(facts, field, half_mm), (-half_um, half_um, -half_um, half_um)
    else:
        light, edge_mm = image_here.light_per_mm2.mean(0), image_here.pitch_mm / 2
        left, right, bottom, top = (
            float(place) * UM_PER_MM
            for line in (image_here.x_mm, image_here.y_mm)
            for place in (line[0] - edge_mm, line[-1] + edge_mm)
        )
        sides_um = (left, right, bottom, top)
    panel.imshow(
        ((light / light.max()) ** _GAMMA).numpy(),
        cmap="inferno",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=sides_um,
        interpolation="nearest" if image_here is None else "bicubic",
    )
    panel.set_facecolor("black")
    angle = to_degrees(facts.lens.field_angles_rad[field])
    strehl = float(image.strehl[field, facts.nearest_wavelength])
    words = "by rays" if math.isnan(strehl) else f"Strehl {strehl:.3g}"
    panel.set(title=f"{angle:.4g}°   {words}", xlim=(-half_um, half_um), ylim=(-half_um, half_um))


def _ray_light(facts: LensFacts, field: int, half_mm: float) -> Tensor:
    """Return a histogram (y, x) of many rays of all wavelengths about the chief ray."""
    pupil = Pupil(definition=facts.pupil.definition, sampling=_CLOUD)
    slope = facts.slopes[field : field + 1]
    spots = spot_diagram(facts.lens, slope, facts.wavelengths_um, pupil)
    x, y = spots.x_mm.flatten(), (spots.y_mm - spots.chief_y_mm).flatten()
    edges = [torch.linspace(-half_mm, half_mm, _CELLS + 1, dtype=torch.float64)] * 2
    points, weight = torch.stack([y, x], dim=-1), spots.weight.flatten()
    light = torch.histogramdd(points, edges, weight=weight).hist
    return light.clamp_min(1e-30)


@chart
def draw_encircled(facts: LensFacts) -> Figure:
    """Draw the share of the light within circles, of some fields and of a perfect lens."""
    image = facts.image
    assert image is not None
    figure = new_figure(9.5, 3.9)
    panel = figure.add_subplot()
    numbers = facts.drawn_fields()
    for i in numbers:
        how = "rays" if image.images[i] is None else "waves"
        label = f"{to_degrees(facts.lens.field_angles_rad[i]):.4g}° by {how}"
        radii_um = image.radii_mm[i] * UM_PER_MM
        panel.plot(radii_um, image.encircled[i], color=field_color(i), label=label)
    wide_um = _half_mm(facts, image, numbers) * UM_PER_MM
    if bool(torch.isfinite(facts.airy_mm).all()):
        radii_um = torch.linspace(0, wide_um, 201, dtype=torch.float64)
        perfect = encircled_airy(radii_um / UM_PER_MM, facts.airy_mm)
        panel.plot(radii_um, perfect, color="black", linestyle=":", label="perfect, on the axis")
    panel.set(
        xlim=(0, wide_um),
        ylim=(0, 1.02),
        ylabel="share of the light",
        xlabel="radius about the centroid, µm"
        + "".join(f"\n{text}" for text in (left_out_text(facts),) if text),
    )
    panel.set_title("all wavelengths with equal weight", loc="left")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
