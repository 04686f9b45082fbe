"""The lens drawn to scale in the meridional plane, with rays, stop and sensor."""

import math
from typing import Any, Final

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.spots import launch_beams
from camkit.models_def.optics.grooves import grooved_mm
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilSamples
from camkit.models_def.optics.trace import Rays, surface_tensors, trace
from camkit.models_def.optics.tracing.frame import Pose
from camkit.report.figure import Figure, Panel, chart, field_color, new_figure
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import to_degrees

RAYS_PER_FIELD: Final = 5
_GLASS_COLOR: Final = "#cfe3f5"
_LEAD: Final = 0.12
_OVERSIZE: Final = 1.06
_POINTS: Final = 81
_GROOVED_POINTS: Final = 1601


@chart
def draw_layout(facts: LensFacts) -> Figure:
    """Draw the lens; rays of every field at the reference wavelength."""
    figure = new_figure(9.5, 3.9)
    draw_layout_on(figure.add_subplot(), facts)
    return figure


def draw_layout_on(panel: Panel, facts: LensFacts) -> None:
    """Draw the lens on a panel of a larger picture."""
    lens = facts.lens
    paths = [_ray_paths(facts, i) for i in range(len(lens.field_angles_rad))]
    heights = _semi_diameters(facts, paths)
    vertices = _vertices(lens)
    _draw_glass(panel, lens, heights, vertices)
    for number in facts.drawn_fields():
        z, y = paths[number]
        angle = to_degrees(lens.field_angles_rad[number])
        color, label = field_color(number), f"{angle:.4g}°"
        for ray in range(z.shape[1]):
            panel.plot(z[:, ray], y[:, ray], color=color, linewidth=0.7, label=label, zorder=3)
            label = "_"
    _draw_stop(panel, facts, heights, vertices)
    tall = float(torch.nan_to_num(torch.abs(facts.chief_mm)).max())
    tall = max(tall * 1.05, 0.3 * max(heights))
    panel.plot([vertices[-1]] * 2, [-tall, tall], color="#222222", linewidth=2, zorder=4)
    panel.axhline(0, color="#999999", linewidth=0.6, dash_capstyle="butt", linestyle="-.")
    panel.set(aspect="equal", xlabel="mm from the first vertex", ylabel="mm")
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
    panel.grid(visible=False)
    panel.legend(title="field", title_fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _vertices(lens: Lens) -> list[float]:
    """Return the places of all vertices and of the sensor."""
    places = [0.0]
    for surface in lens.surfaces:
        places.append(places[-1] + surface.thickness_mm)
    return places


def _ray_paths(facts: LensFacts, field: int) -> tuple[Tensor, Tensor]:
    """Return z and y (point, ray) of a fan; NaN from where a ray is lost."""
    lens = facts.lens
    pupil_y = torch.linspace(-1, 1, RAYS_PER_FIELD, dtype=torch.float64)
    fan = PupilSamples(x=torch.zeros_like(pupil_y), y=pupil_y)
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    slopes = facts.slopes[field : field + 1]
    beams = launch_beams(lens, slopes, wave, fan, facts.pupil.definition)
    history: list[Rays] = []
    last_rays = trace(beams.tensors, beams.rays, surface_rays=history)
    z, y = [], []
    vertices = _vertices(lens)
    for rays, place in zip([*history, last_rays], vertices, strict=True):
        z.append(torch.where(rays.valid, rays.z + place, math.nan)[0, 0])
        y.append(torch.where(rays.valid, rays.y, math.nan)[0, 0])
    lead = -_LEAD * (vertices[-1] - vertices[0])
    if beams.rays.steep:
        # back along each ray from where it meets the first surface
        z.insert(0, z[0] + lead * beams.rays.n[0, 0])
        y.insert(0, y[0] + lead * beams.rays.m[0, 0])
        return torch.stack(z), torch.stack(y)
    lean = (beams.rays.m / beams.rays.n)[0, 0]
    start = torch.full_like(z[0], min(lead, float(torch.nan_to_num(z[0]).min()) + lead))
    z.insert(0, start)
    y.insert(0, beams.rays.y[0, 0] + start * lean)
    return torch.stack(z), torch.stack(y)


def _semi_diameters(facts: LensFacts, paths: list[tuple[Tensor, Tensor]]) -> list[float]:
    """Return the height to which each surface is drawn: its rim, or a little beyond the rays."""
    reach = torch.stack([torch.nan_to_num(torch.abs(y[1:-1])).amax(-1) for _, y in paths]).amax(0)
    least = facts.paraxial.stop_semi_diameter_mm
    heights = []
    for surface, high in zip(facts.lens.surfaces, reach.tolist(), strict=True):
        rim = surface.semi_diameter_mm
        heights.append(rim if math.isfinite(rim) else (high or least) * _OVERSIZE)
    return heights


def _profile(lens: Lens, number: int, height_mm: float) -> tuple[Tensor, Tensor]:
    """Return z and y of a surface, cut off where it ends."""
    surface = lens.surfaces[number]
    square = (1 + surface.conic) * surface.curvature_per_mm**2
    if square > 0:
        height_mm = min(height_mm, 0.999 / math.sqrt(square))
    points = _POINTS if surface.grooves is None else _GROOVED_POINTS
    y = torch.linspace(-height_mm, height_mm, points, dtype=torch.float64)
    z = surface.profile.height_mm(y)
    return z if surface.grooves is None else grooved_mm(z, surface.grooves), y


def _draw_glass(panel: Panel, lens: Lens, heights: list[float], vertices: list[float]) -> None:
    poses = surface_tensors(lens, torch.tensor(lens.reference_wavelength_um)).poses
    for i, surface in enumerate(lens.surfaces):
        solid = surface.glass != "air"
        fronts = [i, i + 1] if solid and i + 1 < len(lens.surfaces) else [i]
        both = [_profile(lens, j, heights[j]) for j in fronts]
        edges = [(z + vertices[j], y) for j, (z, y) in zip(fronts, both, strict=True)]
        if len(edges) == 2:
            (z1, y1), (z2, y2) = edges
            high = max(float(y1[-1]), float(y2[-1]))
            # round the glass and back to where it began
            outline_z = torch.cat([z1, z1[-1:], z2[-1:], z2.flip(0), z2[:1], z1[:1], z1[:1]])
            rims = torch.tensor([high, high, -high, -high], dtype=torch.float64)
            outline_y = torch.cat([y1, rims[:2], y2.flip(0), rims[2:], y1[:1]])
            if poses:
                outline_z, outline_y = _stood(poses[i], outline_z, outline_y, vertices[i])
            panel.fill(outline_z, outline_y, color=_GLASS_COLOR, zorder=1)
            panel.plot(outline_z, outline_y, color="#446688", linewidth=0.8, zorder=2)
        elif i != lens.stop and (i == 0 or lens.surfaces[i - 1].glass == "air"):
            panel.plot(*edges[0], color="#446688", linewidth=0.8, zorder=2)


def _stood(pose: Pose | None, z: Tensor, y: Tensor, vertex: float) -> tuple[Tensor, Tensor]:
    """Return points of the meridional plane of an element where it stands, seen along x."""
    if pose is None:
        return z, y
    points = torch.stack([torch.zeros_like(y), y, z - vertex]).to(pose.turn)
    _, turned_y, turned_z = pose.turn @ points + pose.offset_mm[:, None]
    return turned_z + vertex, turned_y


def _draw_stop(panel: Panel, facts: LensFacts, heights: list[float], vertices: list[float]) -> None:
    """Draw the stop as two bars that begin at its edge."""
    number = facts.lens.stop
    edge = facts.real_stop_mm or facts.paraxial.stop_semi_diameter_mm
    outer = max(1.35 * edge, 1.15 * max(heights))
    z, _ = _profile(facts.lens, number, edge)
    place = vertices[number] + float(z[-1])
    for sign in (-1, 1):
        panel.plot([place] * 2, [sign * edge, sign * outer], color="black", linewidth=2.5, zorder=5)
    style: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "top"}
    panel.annotate("stop", (place, -outer), (0, -3), fontsize=8, **style)
