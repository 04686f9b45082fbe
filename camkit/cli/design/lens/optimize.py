"""`camkit lens optimize`: a lens made better on spots."""

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from camkit.cli.choices import (
    Configuration,
    Debug,
    GlassCatalogues,
    GlassFiles,
    Json,
    Overwrite,
    several_states,
)
from camkit.cli.say import say
from camkit.errors import ContractError, UnsupportedError
from camkit.progress import working
from camkit.units import to_degrees

if TYPE_CHECKING:
    from torch import Tensor

    from camkit.models_def.optics.prescription import Lens
    from camkit.models_def.optics.search.improvement import Improvement
    from camkit.models_def.optics.search.least_squares import Residuals
    from camkit.models_def.optics.search.problem import Problem
    from camkit.models_def.optics.search.variables import FreeLens

    _Outcome = tuple[Lens, dict[str, Any], list[str]]
    """The better lens, facts of the search, and notes."""

RINGS: Final = 12
UNITS: Final = {"rms": "mm²", "sum_abs": "mm", "energy": "mm²"}
"""Of the merits."""
GAPS: Final = "gaps"
"""The word of `--vary` for the gaps that configurations name."""


def optimize(
    source: Annotated[
        Path,
        typer.Argument(help="Lens file (.toml, .zmx, .json) or built-in name.", metavar="FILE"),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Improved lens to write (.toml, .zmx or .json).")
    ],
    vary: Annotated[
        str | None,
        typer.Option(
            help="List of curvature, conic, thickness, even_asphere, odd_asphere, q_asphere, "
            "phase, gaps.",
            show_default="`vary` of each surface",
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
    configurations: Annotated[
        str | None,
        typer.Option(
            help="States of a lens that count together: all, or NAME,NAME; default: one alone."
        ),
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(help="With --configurations: weight of each, such as 2,1; default: equal."),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Improve a lens by damped least squares on its spots (needs torch)."""
    from camkit.cli.design.design_time import refuse_existing, require_torch

    require_torch("camkit lens optimize")
    refuse_existing([out], overwrite=overwrite)
    from camkit.models_def.optics.lens_file.lens_file import (
        read_configured_lens,
        read_noted_lens,
        ready_for_lens,
        write_lens,
    )
    from camkit.models_def.torch_threads import one_torch_thread

    ready_for_lens(out)
    improve = partial(_improve, starts=starts, spread=spread, steps=steps, seed=seed)
    problem_of = partial(_problem, merit=merit, core_mm=core_um / 1000, rays=rays)
    files = (source, glass or (), catalogue)
    if configurations is None:
        if weights is not None:
            raise ContractError("--weights belongs to --configurations")
        lens, notes = read_noted_lens(*files, configuration)
        if lens.state:
            notes = (
                *notes,
                f"{out.name} holds configuration {lens.state} alone; "
                "name others by --configurations",
            )
        search = partial(_alone, lens, vary, problem_of, improve)
    else:
        _check_joint(out, configuration)
        lens, notes = read_configured_lens(*files)
        choice = several_states(configurations) or "", weights
        search = partial(_together, lens, vary, choice, problem_of, improve)
    with one_torch_thread(), working(f"improving {lens.name}"):
        better, facts, notes_of_search = search()
    write_lens(better, out)
    report = {"lens": lens.name, "out": str(out), "merit": merit, **facts}
    report["notes"] = [*notes, *notes_of_search]
    for note in report["notes"]:
        say(f"{source.name}: {note}", err=True)
    say(json.dumps(report) if json_ else _text(report))


def _check_joint(out: Path, configuration: str | None) -> None:
    """Refuse what does not go with several configurations."""
    from camkit.cli.design.lens.convert import STATEFUL

    if configuration is not None:
        raise ContractError("--configurations takes several; leave --configuration out")
    if out.suffix.lower() not in STATEFUL:
        raise ContractError(f"{' and '.join(STATEFUL)} hold several configurations; got {out.name}")


def _alone(
    lens: "Lens",
    vary: str | None,
    problem_of: "Callable[[FreeLens], Problem]",
    improve: "Callable[[Residuals | Problem, Tensor], Improvement]",
) -> "_Outcome":
    """Improve a lens in one state."""
    from camkit.models_def.optics.analysis.focus_note import focus_note
    from camkit.models_def.optics.search.improvement import free_lens, on_limits
    from camkit.models_def.optics.search.own_frame import in_own_frame

    free, moves = _free(lens, vary)
    free, plane_notes = _without_flat_conics(lens, free)
    if moves:
        raise ContractError("--vary gaps are those of --configurations; name thickness")
    problem = problem_of(free_lens(lens, free))
    begin = problem.free.scaled()
    problem = in_own_frame(problem, begin)
    result = improve(problem, begin)
    better = problem.free.lens_at(result.scaled)
    facts = _merits(result, len(problem.free.variables))
    facts |= _comparison(lens, better)
    facts["on_limits"] = on_limits(problem.free.variables, result.scaled)
    notes = [*focus_note(lens), *plane_notes, *_limit_notes(facts["on_limits"])]
    return better, facts, [*notes, *_small_rims(problem, result.scaled)]


def _together(
    lens: "Lens",
    vary: str | None,
    choice: tuple[str | tuple[str, ...], str | None],
    problem_of: "Callable[[FreeLens], Problem]",
    improve: "Callable[[Residuals | Problem, Tensor], Improvement]",
) -> "_Outcome":
    """Improve a lens in several configurations at once."""
    from camkit.models_def.optics.analysis.focus_note import focus_note
    from camkit.models_def.optics.lens_file.states import plain_lens
    from camkit.models_def.optics.optics_file import state_names
    from camkit.models_def.optics.search.improvement import on_limits
    from camkit.models_def.optics.search.joint_states import joint_problem

    words, weights = choice
    free, moves = _free(lens, vary)
    free, plane_notes = _without_flat_conics(lens, free)
    joint = joint_problem(
        lens,
        state_names(lens, words),
        free,
        problem_of,
        moves=moves,
        weights=() if weights is None else _numbers(weights),
    ).in_own_frame()
    result = improve(joint.residuals, joint.scaled())
    better = joint.lens_at(result.scaled)
    limits = [
        f"{one.state}: {name}" if one.state else name
        for one, scaled in zip(joint.variables, result.scaled, strict=True)
        for name in on_limits([one.variable], scaled[None])
    ]
    states, notes = {}, [*plane_notes, *_limit_notes(limits)]
    for term in joint.terms:
        before, after = (plain_lens(one, term.name) for one in (lens, better))
        states[term.name] = {"weight": term.weight, **_comparison(before, after)}
        rims = _small_rims(term.problem, result.scaled[term.places])
        notes += [f"{term.name}: {line}" for line in (*focus_note(before), *rims)]
    facts = _merits(result, len(joint.variables)) | {"configurations": states, "on_limits": limits}
    return better, facts, notes


def _limit_notes(names: Sequence[str]) -> list[str]:
    return [f"on the limit of its range: {', '.join(names)}"] if names else []


def _merits(result: "Improvement", variables: int) -> dict[str, Any]:
    return {
        "merit_before": result.merit_before,
        "merit_after": result.merit,
        "variables": variables,
        "evaluations": result.evaluations,
    }


def _small_rims(problem: "Problem", scaled: "Tensor") -> list[str]:
    from camkit.models_def.optics.search.own_frame import too_small_rims

    return [
        f"surface {surface}: the beam needs {reach_mm:.3f} mm, the rim of {rim_mm:.3f} mm stays"
        for surface, reach_mm, rim_mm in too_small_rims(problem, scaled)
    ]


def _improve(merit: "Residuals | Problem", begin: "Tensor", **options: Any) -> "Improvement":
    from camkit.models_def.optics.search.improvement import improve

    return improve(merit, begin, **options)


def _free(lens: "Lens", vary: str | None) -> tuple[list[Any], bool]:
    """Return what is free of each surface, and whether moving gaps are too."""
    from camkit.models_def.optics.prescription import VARY
    from camkit.models_def.optics.search.improvement import refracting_surfaces

    if vary is None:
        return [surface.vary for surface in lens.surfaces], False
    words = tuple(name.strip() for name in vary.split(",") if name.strip())
    names = tuple(word for word in words if word != GAPS)
    if not set(names) <= set(VARY):
        raise ContractError(f"--vary names some of {', '.join((*VARY, GAPS))}; got {vary!r}")
    refracting = refracting_surfaces(lens)
    free = [names if i in refracting else () for i in range(len(lens.surfaces))]
    return free, GAPS in words


def _without_flat_conics(lens: "Lens", free: list[Any]) -> tuple[list[Any], list[str]]:
    """Return what is free without conics of surfaces that are plane and stay so, and a note."""
    flat = [
        i
        for i, (surface, names) in enumerate(zip(lens.surfaces, free, strict=True))
        if "conic" in names and "curvature" not in names and surface.curvature_per_mm == 0
    ]
    if not flat:
        return free, []
    names = ", ".join(map(str, flat))
    rest = [
        tuple(name for name in names if i not in flat or name != "conic")
        for i, names in enumerate(free)
    ]
    return rest, [f"a plane has no conic: that of surface {names} is not free"]


def _comparison(before: "Lens", after: "Lens") -> dict[str, Any]:
    """Return focal lengths and spots of a lens and of the better one, and fields that lost."""
    angles = [round(to_degrees(angle), 9) for angle in before.field_angles_rad]
    spots, better = _spots(before), _spots(after)
    focused = _refocused(before)
    return {
        "efl_mm_before": _efl_mm(before),
        "efl_mm_after": _efl_mm(after),
        "field_angles_deg": angles,
        "spot_rms_mm_before": spots,
        "spot_rms_mm_refocused": None if focused is None else _spots(focused),
        "spot_rms_mm_after": better,
        "worse_fields_deg": [
            angle for angle, old, new in zip(angles, spots, better, strict=True) if new > old
        ],
    }


def _refocused(lens: "Lens") -> "Lens | None":
    """Return the lens with its sensor at the least spots; None if it cannot be focused so."""
    from camkit.models_def.optics.focus import with_focus

    try:
        return with_focus(lens, "spot")
    except (ContractError, UnsupportedError):
        return None


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ContractError(f"--weights takes numbers A,B; got {text!r}") from None


def _problem(free: "FreeLens", *, merit: str, core_mm: float, rays: int) -> "Problem":
    import torch

    from camkit.models_def.optics.aiming.field import widest_tangent
    from camkit.models_def.optics.pupil import half_disc
    from camkit.models_def.optics.search.limits import Limits
    from camkit.models_def.optics.search.problem import Problem
    from camkit.models_def.optics.search.spot_residuals import MERITS

    if merit not in MERITS:
        raise ContractError(f"--merit is one of {', '.join(MERITS)}; got {merit!r}")
    lens = free.lens
    waves = lens.wavelengths_um
    if len(waves) % 2 == 0:
        waves = tuple(sorted((*waves, lens.reference_wavelength_um)))
    widest_tangent(lens.field_angles_rad, "optimisation")
    angles = torch.tensor(sorted({0.0, *lens.field_angles_rad}), dtype=torch.float64)
    return Problem(
        free=free,
        slopes=torch.tan(angles),
        wavelengths_um=torch.tensor(waves, dtype=torch.float64),
        samples=half_disc(rays),
        merit=merit,
        core_mm=core_mm,
        limits=Limits(min_bfl_mm=1.0, max_curvature_per_mm=1.0),
    )


def _efl_mm(lens: "Lens") -> float:
    from camkit.models_def.optics.paraxial import paraxial_data

    return float(paraxial_data(lens).efl_mm)


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


_WHEN: Final = ("before", "after")


def _text(report: dict[str, Any]) -> str:
    merit = report["merit"]
    lines = [
        f"{report['lens']}: merit {report['merit_before']:.4g} -> {report['merit_after']:.4g} "
        f"{UNITS[merit]} ({merit}, {report['variables']} variables, {report['evaluations']} lenses "
        "traced)"
    ]
    for name, state in report.get("configurations", {"": report}).items():
        steps = [state[f"spot_rms_mm_{when}"] for when in ("before", "refocused", "after")]
        columns = [spots for spots in steps if spots is not None]
        fields = ", ".join(
            f"{angle:.4g} degrees " + " -> ".join(f"{1000 * mm:.1f}" for mm in row)
            for angle, *row in zip(state["field_angles_deg"], *columns, strict=True)
        )
        stages = "file -> refocused -> improved" if all(steps) else "file -> improved"
        efl = " -> ".join(dict.fromkeys(f"{state[f'efl_mm_{when}']:.4g}" for when in _WHEN))
        worse = ", ".join(f"{angle:.4g}" for angle in state["worse_fields_deg"])
        lines.append(
            (f"{name}: " if name else "")
            + f"EFL {efl} mm. RMS spots of the fields in um, {stages}: {fields}"
            + (f"; worse at {worse} degrees" if worse else "")
        )
    return "\n".join([*lines, report["out"]])
