"""`camkit lens optimize`: a lens made better on spots."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import working

if TYPE_CHECKING:
    from camkit.models_def.optics.prescription import Lens
    from camkit.models_def.optics.search.problem import Problem

RINGS: Final = 12


def optimize(
    source: Annotated[
        Path, typer.Argument(help="Lens file (.toml, .zmx or .json).", metavar="FILE")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Improved lens to write (.toml, .zmx or .json).")
    ],
    vary: Annotated[
        str | None,
        typer.Option(
            help="Variables, such as curvature,conic,thickness; default: `vary` of each surface."
        ),
    ] = None,
    merit: Annotated[str, typer.Option(help="Merit function: rms, sum_abs or energy.")] = "sum_abs",
    core_um: Annotated[
        float, typer.Option(min=0.01, help="Radius in um below which a spot counts as sharp.")
    ] = 6.0,
    starts: Annotated[
        int, typer.Option(min=1, help="Number of starting points near the lens.")
    ] = 8,
    spread: Annotated[
        float,
        typer.Option(
            min=0,
            max=1,
            help="Distance of the starting points, as a share of each variable's range.",
        ),
    ] = 0.05,
    steps: Annotated[
        int, typer.Option(min=1, help="Number of optimization steps from the best starting points.")
    ] = 60,
    rays: Annotated[int, typer.Option(min=4, help="Number of rays in half the pupil.")] = 24,
    seed: Annotated[int, typer.Option(help="Random seed of the starting points.")] = 1,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Improve a lens by damped least squares on its spots (needs torch)."""
    from camkit.cli.design.design_time import refuse_existing, require_torch

    require_torch("camkit lens optimize")
    refuse_existing([out], overwrite=overwrite)
    from camkit.models_def.optics.lens_file.lens_file import (
        read_noted_lens,
        ready_for_lens,
        write_lens,
    )
    from camkit.models_def.optics.search.improvement import improve
    from camkit.models_def.optics.search.own_frame import in_own_frame, too_small_rims
    from camkit.models_def.torch_threads import one_torch_thread

    ready_for_lens(out)
    lens, read_notes = read_noted_lens(source, glass or (), catalogue, configuration)
    problem = _problem(lens, vary, merit=merit, core_mm=core_um / 1000, rays=rays)
    begin = problem.free.scaled()
    problem = in_own_frame(problem, begin)
    with one_torch_thread(), working(f"improving {lens.name}"):
        result = improve(problem, begin, starts=starts, spread=spread, steps=steps, seed=seed)
    better = problem.free.lens_at(result.scaled)
    write_lens(better, out)
    notes = [
        *read_notes,
        *(
            f"surface {surface}: the beam needs {reach_mm:.3f} mm, the rim of {rim_mm:.3f} mm stays"
            for surface, reach_mm, rim_mm in too_small_rims(problem, result.scaled)
        ),
    ]
    report = {
        "lens": lens.name,
        "out": str(out),
        "merit": merit,
        "merit_before": result.merit_before,
        "merit_after": result.merit,
        "variables": len(problem.free.variables),
        "evaluations": result.evaluations,
        "spot_rms_mm_before": _spots(lens),
        "spot_rms_mm_after": _spots(better),
        "notes": notes,
    }
    for note in notes:
        say(f"{source.name}: {note}", err=True)
    say(json.dumps(report) if json_ else _text(report))


def _problem(lens: "Lens", vary: str | None, *, merit: str, core_mm: float, rays: int) -> "Problem":
    import torch

    from camkit.models_def.optics.prescription import VARY
    from camkit.models_def.optics.pupil import half_disc
    from camkit.models_def.optics.search.improvement import free_lens, refracting_surfaces
    from camkit.models_def.optics.search.limits import Limits
    from camkit.models_def.optics.search.problem import Problem
    from camkit.models_def.optics.search.spot_residuals import MERITS

    if merit not in MERITS:
        raise ContractError(f"--merit is one of {', '.join(MERITS)}; got {merit!r}")
    free: list[Any] = [surface.vary for surface in lens.surfaces]
    if vary is not None:
        names = tuple(name.strip() for name in vary.split(",") if name.strip())
        if not set(names) <= set(VARY):
            raise ContractError(f"--vary names some of {', '.join(VARY)}; got {vary!r}")
        refracting = refracting_surfaces(lens)
        free = [names if i in refracting else () for i in range(len(lens.surfaces))]
    waves = lens.wavelengths_um
    if len(waves) % 2 == 0:
        waves = tuple(sorted((*waves, lens.reference_wavelength_um)))
    angles = torch.tensor(sorted({0.0, *lens.field_angles_rad}), dtype=torch.float64)
    return Problem(
        free=free_lens(lens, free),
        slopes=torch.tan(angles),
        wavelengths_um=torch.tensor(waves, dtype=torch.float64),
        samples=half_disc(rays),
        merit=merit,
        core_mm=core_mm,
        limits=Limits(min_bfl_mm=1.0, max_curvature_per_mm=1.0),
    )


def _spots(lens: "Lens") -> list[float]:
    """Return the RMS spot radius in mm of every field, all wavelengths about one centroid."""
    import torch

    from camkit.models_def.optics.pupil import hexapolar
    from camkit.models_def.optics.spot import all_waves, rms_radius, trace_spots

    slopes = torch.tan(torch.tensor(lens.field_angles_rad, dtype=torch.float64))
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    with torch.no_grad():
        spots = trace_spots(lens, slopes, waves, hexapolar(RINGS), definition="paraxial")
        radii: list[float] = rms_radius(all_waves(spots))[:, 0].tolist()
    return radii


def _text(report: dict[str, Any]) -> str:
    before, after = report["spot_rms_mm_before"], report["spot_rms_mm_after"]
    fields = ", ".join(
        f"{1000 * a:.1f} -> {1000 * b:.1f}" for a, b in zip(before, after, strict=True)
    )
    return (
        f"{report['lens']}: merit {report['merit_before']:.4g} -> {report['merit_after']:.4g} "
        f"({report['merit']}, {report['variables']} variables, {report['evaluations']} lenses "
        f"traced)\nRMS spots of the fields in um: {fields}\n{report['out']}"
    )
