"""Figures 3.3 and 3.4 of the thesis for a thin plate of ours: ideal phase and virtual apertures.

    python -m tools.lens.plate_figures thin_plate_lens -o DIR

Solves the plate of a recipe of `camkit lens thin` and writes into DIR

    phase.png       the phase that every direction would want of the whole aperture (eq. 3.3),
                    wrapped by 1000 pi, the virtual apertures upon it
    apertures.png   where these lie on the plate, the rays of three directions, their spots
    figures.json    the numbers of both

The image points are those of the solver, the distance to them is the focal length: the map is of a
plane, the plate is as thick as it is.
"""

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter

from camkit.models_def.optics.grooves import grooved_mm
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilSamples, pupil_rays
from camkit.models_def.optics.thin.ideal import ideal_phase
from camkit.models_def.optics.thin.peak import (
    LandedLight,
    land_light,
    peak_height_px,
    within,
)
from camkit.models_def.optics.thin.plate_lens import plate_lens
from camkit.models_def.optics.thin.recipe import ThinRecipe, find_thin_recipe
from camkit.models_def.optics.thin.solver import SolvedPlate, solve_plate
from camkit.models_def.optics.trace import Rays, surface_tensors, trace
from camkit.report.figure import new_figure, to_png
from camkit.units import to_degrees
from tools.hdr.record import in_one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WRAP_PI: Final = 1000.0
"""As the thesis wraps its map, in units of pi."""
PITCH_UM: Final = 5.96
GRID: Final = 500
"""Samples of the map along a side."""
FAN: Final = 47
"""Rays of a direction in the section."""
SPOT_RAYS: Final = 60_000
SPOT_PX: Final = 450
SPOT_STEP_PX: Final = 6
PEAK_PX: Final = 24
DARKEST: Final = 1e-4
"""Of the densest pixel of a spot, what is still drawn."""
_FRONT: Final = 1
_PROFILE_POINTS: Final = 2001

Array = NDArray[np.float64]


@in_one_line
def main() -> None:
    """Solve, draw, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recipe", type=Path, help="of `camkit lens thin`: a file, or a name")
    parser.add_argument("-o", "--out-dir", type=Path, required=True)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    recipe = find_thin_recipe(chosen.recipe)
    solved = solve_plate(recipe)
    lens = plate_lens(recipe, solved)
    spots = [spot_of(lens, angle) for angle in shown_angles(solved)]
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    (chosen.out_dir / "phase.png").write_bytes(to_png(draw_phase(recipe, solved)))
    figure = draw_apertures(recipe, solved, lens, spots)
    (chosen.out_dir / "apertures.png").write_bytes(to_png(figure))
    told = to_json(recipe, solved, spots)
    (chosen.out_dir / "figures.json").write_text(json.dumps(told, indent=1) + "\n", "utf-8")
    print(to_text(told))


def phase_map(recipe: ThinRecipe, solved: SolvedPlate, radii_mm: Array, angles_rad: Array) -> Array:
    """Return the phase (radius, angle) in radians that every direction would want, not wrapped.

    Args:
        recipe: Focal length and wavelength.
        solved: The image points, between whose directions heights are interpolated.
        radii_mm: Along the meridian, signed.
        angles_rad: Within the directions of the plate.
    References: Sun 2021, eq. (3.3).
    """
    plate = recipe.plate
    # the mean of the rays on the axis lies beside it by what their lattice is not symmetric
    known_mm = [0.0, *solved.heights_mm[1:]]
    heights = PchipInterpolator(solved.apertures.field_angles_rad, known_mm)(angles_rad)
    columns = [
        ideal_phase(radii_mm, float(angle), float(height), plate.efl_mm, plate.wavelength_um)
        for angle, height in zip(angles_rad, heights, strict=True)
    ]
    return np.stack(columns, axis=1)


def wrapped(phase: Array) -> Array:
    """Return phases within 0..`WRAP_PI` pi, in units of pi."""
    return np.asarray(np.mod(phase / math.pi, WRAP_PI))


def shown_angles(solved: SolvedPlate) -> list[float]:
    """Return the first, the middle and the last direction."""
    angles = solved.apertures.field_angles_rad
    return [angles[0], angles[len(angles) // 2], angles[-1]]


def spot_of(lens: Lens, angle_rad: float) -> tuple[LandedLight, float]:
    """Return the light of a direction on the sensor, and the height of its peak in pixels."""
    light = land_light(lens, angle_rad, lens.reference_wavelength_um, PITCH_UM, SPOT_RAYS)
    return light, peak_height_px(light)


def draw_phase(recipe: ThinRecipe, solved: SolvedPlate) -> "Figure":
    """Draw the map of figure 3.3, and the virtual apertures upon it."""
    reach_mm = recipe.plate.aperture_mm / 2
    radii = np.linspace(-reach_mm, reach_mm, GRID)
    angles = np.linspace(0.0, solved.apertures.field_angles_rad[-1], GRID)
    figure = new_figure(5.6, 4.2)
    panel = figure.subplots()
    end_deg, end = to_degrees(float(angles[-1])), reach_mm / recipe.plate.efl_mm
    image = panel.imshow(
        wrapped(phase_map(recipe, solved, radii, angles)),
        origin="lower",
        extent=(0, end_deg, -end, end),
        aspect="auto",
        cmap="twilight",
        vmin=0,
        vmax=WRAP_PI,
        interpolation="nearest",
    )
    discs = solved.apertures
    for angle, centre in zip(discs.field_angles_rad, discs.centres_mm, strict=True):
        low, high = ((centre + side * discs.radius_mm) / recipe.plate.efl_mm for side in (-1, 1))
        line = panel.plot([to_degrees(angle)] * 2, [low, high], color="#ffd000", linewidth=2.5)
        line[0].set_clip_on(False)
    panel.set_xlabel("field angle, degrees")
    panel.set_ylabel("radius on the plate / focal length")
    panel.set_title("ideal phase; bars: the virtual apertures", fontsize=9)
    figure.colorbar(image, ax=panel, label=f"phase modulo {WRAP_PI:g} π, in π")
    return figure


def draw_apertures(
    recipe: ThinRecipe,
    solved: SolvedPlate,
    lens: Lens,
    spots: list[tuple[LandedLight, float]],
) -> "Figure":
    """Draw figure 3.4: the discs on the plate, rays of three directions, their spots."""
    figure = new_figure(8.2, 5.9)
    halves: Any = figure.subfigures(2, 1, height_ratios=(1.25, 1))
    above, below = halves
    section, front = above.subplots(1, 2, width_ratios=(1.5, 1))
    _draw_section(section, lens, solved)
    _draw_front(front, recipe, solved)
    panels = below.subplots(1, len(spots))
    for panel, angle, (light, peak_px) in zip(panels, shown_angles(solved), spots, strict=True):
        _draw_spot(panel, light, peak_px)
        share = within(light, peak_px, 10.0)
        title = f"{to_degrees(angle):.1f}°: {share:.0%} within 10 px of the peak"
        panel.set_title(title, fontsize=8, color=_color(angle, solved))
    below.suptitle(
        f"light within {SPOT_PX} px of the peak (logarithmic), and within {PEAK_PX} px (linear)",
        fontsize=8,
    )
    return figure


def _color(angle_rad: float, solved: SolvedPlate) -> tuple[float, float, float, float]:
    from matplotlib import colormaps

    share = angle_rad / solved.apertures.field_angles_rad[-1]
    red, green, blue, full = colormaps["turbo"](0.08 + 0.84 * share)
    return 0.85 * red, 0.85 * green, 0.85 * blue, full


def _draw_section(panel: "Axes", lens: Lens, solved: SolvedPlate) -> None:
    places = np.cumsum([0.0, *(surface.thickness_mm for surface in lens.surfaces)])
    outlines = []
    for number in (_FRONT, _FRONT + 1):
        surface = lens.surfaces[number]
        rim = surface.semi_diameter_mm
        y = torch.linspace(-rim, rim, _PROFILE_POINTS, dtype=torch.float64)
        z = surface.profile.height_mm(y)
        relief = z if surface.grooves is None else grooved_mm(z, surface.grooves)
        outlines.append((relief.numpy() + places[number], y.numpy()))
    (z1, y1), (z2, y2) = outlines
    outline = np.concatenate([z1, z2[::-1]]), np.concatenate([y1, y2[::-1]])
    panel.fill(*outline, color="#cfe3f5", zorder=1)
    panel.plot(*outline, color="#446688", linewidth=0.5, zorder=2)
    discs = solved.apertures
    for angle in shown_angles(solved):
        along, up, alive = _fan(lens, angle, places)
        centre = discs.centres_mm[discs.field_angles_rad.index(angle)]
        for ray in range(up.shape[1]):
            inside = abs(float(up[_FRONT + 1, ray]) - centre) <= discs.radius_mm
            if not alive[ray]:
                continue
            color = _color(angle, solved) if inside else "#bbbbbb"
            panel.plot(along[:, ray], up[:, ray], color=color, linewidth=0.6, zorder=4 * inside)
    tall = 1.1 * max(solved.heights_mm)
    panel.plot([places[-1]] * 2, [-0.3 * tall, tall], color="#222222", linewidth=2, zorder=5)
    panel.set_aspect("equal")
    panel.set_xlabel("mm", fontsize=8)
    panel.set_ylabel("mm", fontsize=8)
    panel.tick_params(labelsize=7)
    panel.set_title("rays within (coloured) and beside the virtual apertures", fontsize=8)


def _fan(lens: Lens, angle_rad: float, places: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return z and y (point, ray) of a direction in the meridian, and which rays arrive."""
    tensors = surface_tensors(lens, torch.tensor(lens.reference_wavelength_um, dtype=torch.float64))
    across = torch.linspace(-1, 1, FAN, dtype=torch.float64)
    slope = torch.tensor([math.tan(angle_rad)], dtype=torch.float64)
    seen: list[Rays] = []
    with torch.no_grad():
        samples = PupilSamples(x=torch.zeros_like(across), y=across)
        launched, _ = pupil_rays(lens, tensors, samples, slope)
        landed = trace(tensors, launched, seen=seen)
    z = [rays.z.numpy() + place for rays, place in zip([*seen, landed], places, strict=True)]
    y = [rays.y.numpy() for rays in [*seen, landed]]
    before = z[0] - 12.0
    z.insert(0, before)
    y.insert(0, y[0] - 12.0 * math.tan(angle_rad))
    return np.stack(z), np.stack(y), landed.valid.numpy()


def _draw_front(panel: "Axes", recipe: ThinRecipe, solved: SolvedPlate) -> None:
    from matplotlib.patches import Circle

    discs, rim_mm = solved.apertures, recipe.plate.aperture_mm / 2
    panel.add_patch(Circle((0, 0), rim_mm, fill=False, color="#446688", linewidth=1.5))
    for angle, centre in zip(discs.field_angles_rad, discs.centres_mm, strict=True):
        label = f"{to_degrees(angle):.1f}°: {centre:.1f} mm"
        color = _color(angle, solved)
        disc = Circle((0, centre), discs.radius_mm, fill=False, color=color, label=label)
        panel.add_patch(disc)
        panel.plot([0], [centre], "+", color=color, markersize=6)
    panel.set_xlim(-1.1 * rim_mm, 1.1 * rim_mm)
    panel.set_ylim(-1.1 * rim_mm, 1.1 * rim_mm)
    panel.set_aspect("equal")
    panel.set_axis_off()
    panel.set_title(f"virtual apertures, radius {discs.radius_mm:g} mm, on the plate", fontsize=8)
    panel.legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_spot(panel: "Axes", light: LandedLight, peak_px: float) -> None:
    from matplotlib.colors import LogNorm

    # the rays lie on a lattice, whose rings are not those of the light
    wide = gaussian_filter(spot_image(light, peak_px, SPOT_PX, step_px=SPOT_STEP_PX), 1.0)
    norm = LogNorm(DARKEST * wide.max(), wide.max(), clip=True)
    extent = (-SPOT_PX, SPOT_PX, -SPOT_PX, SPOT_PX)
    panel.imshow(wide, origin="lower", cmap="magma", norm=norm, extent=extent)
    near = spot_image(light, peak_px, PEAK_PX, step_px=1)
    inset = panel.inset_axes((0.64, 0.64, 0.35, 0.35))
    inset.imshow(near, origin="lower", cmap="magma")
    for axes in (panel, inset):
        axes.set_xticks([])
        axes.set_yticks([])
    for spine in inset.spines.values():
        spine.set_color("white")


def spot_image(light: LandedLight, peak_px: float, reach_px: int, *, step_px: int) -> Array:
    """Return the light by cell (n, n) about a peak, rows outward, both halves of the pupil.

    Args:
        light: Of rays with x >= 0 in the pupil.
        peak_px: Height of the peak.
        reach_px: From the peak to the rim of the picture.
        step_px: Side of a cell.
    """
    edges = np.arange(-reach_px, reach_px + step_px, step_px, dtype=np.float64)
    down = light.y_px - peak_px
    made, _, _ = np.histogram2d(down, light.x_px, bins=(edges, edges), weights=light.share)
    return np.asarray((made + made[:, ::-1]) / 2)


def to_json(
    recipe: ThinRecipe, solved: SolvedPlate, spots: list[tuple[LandedLight, float]]
) -> dict[str, Any]:
    """Return the numbers of both figures as plain JSON values."""
    discs, plate = solved.apertures, recipe.plate
    rim = np.array([-plate.aperture_mm / 2, plate.aperture_mm / 2])
    rims = phase_map(recipe, solved, rim, np.array(discs.field_angles_rad)) / math.pi
    return {
        "recipe": recipe.name,
        "efl_mm": plate.efl_mm,
        "wavelength_um": plate.wavelength_um,
        "aperture_mm": plate.aperture_mm,
        "wrap_pi": WRAP_PI,
        "virtual_aperture_radius_mm": discs.radius_mm,
        "directions": [
            {
                "field_angle_deg": round(to_degrees(angle), 4),
                "centre_mm": round(centre, 4),
                "image_height_mm": round(height, 4),
                "spot_rms_um": round(rms, 2),
                "phase_at_the_rims_pi": [round(float(v), 1) for v in rims[:, number]],
            }
            for number, (angle, centre, height, rms) in enumerate(
                zip(
                    discs.field_angles_rad,
                    discs.centres_mm,
                    solved.heights_mm,
                    solved.spot_rms_um,
                    strict=True,
                )
            )
        ],
        "spots": [
            {
                "field_angle_deg": round(to_degrees(angle), 4),
                "peak_px": round(peak_px, 2),
                "within_10_px": round(within(light, peak_px, 10.0), 4),
                f"within_{SPOT_PX}_px": round(within(light, peak_px, SPOT_PX), 4),
            }
            for angle, (light, peak_px) in zip(shown_angles(solved), spots, strict=True)
        ],
    }


def to_text(told: dict[str, Any]) -> str:
    """Return the virtual apertures, as `to_json` has them, as a table in Markdown."""
    lines = [
        "| degrees | centre, mm | image, mm | spot, µm rms | phase at the rims, π |",
        "|---|---|---|---|---|",
    ]
    for d in told["directions"]:
        low, high = d["phase_at_the_rims_pi"]
        lines.append(
            f"| {d['field_angle_deg']:.1f} | {d['centre_mm']:.2f} | {d['image_height_mm']:.2f} "
            f"| {d['spot_rms_um']:.0f} | {low:.0f}, {high:.0f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
