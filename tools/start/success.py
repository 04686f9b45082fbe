"""Success of a search for a start: at random within a form, and from the library of lenses.

    python -m tools.start.success --seconds 3 --seeds 3 -o docs/results/library-starts.json

Every task states focal length, F-number, field, back focus and the number of elements. All arms
minimise the same merit with the same bounds and limits, one thread; the random search has at least
the CPU seconds of the library:

- `random`: today's search, `anywhere` = 1. It is told the form: the sequence of glasses and the
  place of the stop. Curvatures, gaps and shapes are drawn from all over their bounds.
- `library`: `starts.library` with the number of elements, half of the draws from all over the
  bounds. It is told no form.
- `library without the form`: the same where the lens that the form was taken from is not shipped.

A run succeeds if its RMS spot, limits counted, lies within 5 % of the best of all runs of a task.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

import torch

from camkit.errors import ContractError
from camkit.models_def.design.starts import Starts, best_starts, library_starts
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.improvement import refracting_surfaces
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.optics.search.variables import FreeLens, Variable
from camkit.units import to_radians

RANDOM, LIBRARY, NO_FORM = ARMS = ("random", "library", "library without the form")
SUCCESS_RATIO: Final = 1.05
_WAVES_UM: Final = (0.4861327, 0.5875618, 0.6562725)
_FIELDS: Final = 5
_CURVATURE: Final = 4.0
_GLASS: Final = (0.02, 0.25)
_AIR: Final = (0.002, 0.5)
_CONIC: Final = (-10.0, 5.0)
_TERMS: Final = 3
_SAG_SHARE: Final = 0.02
_REACH_SHARE: Final = 0.3
_EDGE: Final = 0.012
_JUDGED_RAYS: Final = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A lens that is asked for.

    Attributes:
        name: For people.
        form: Built-in lens whose sequence of glasses and stop the random search is told.
        efl_mm: Focal length.
        f_number: EFL / entrance pupil diameter.
        half_field_deg: Of the corner.
        min_bfl_mm: Least back focus.
        aspheric: Whether conics and terms up to r^8 are free on every surface.
    """

    name: str
    form: str
    efl_mm: float
    f_number: float
    half_field_deg: float
    min_bfl_mm: float
    aspheric: bool = False


_ROWS: Final = (
    # name, form, EFL, F-number, half field, least back focus, aspheric
    ("portrait, three", "cooke-triplet", 85.0, 4.0, 14.0, 50.0, False),
    ("normal, three", "cooke-triplet", 50.0, 3.5, 22.0, 30.0, False),
    ("normal, four", "tessar", 50.0, 3.2, 21.0, 25.0, False),
    ("flat field, four", "triplet-flattener", 35.0, 4.5, 24.0, 0.5, False),
    ("long back focus, five", "retrofocus", 24.0, 4.0, 26.0, 38.0, False),
    ("fast, six", "double-gauss", 50.0, 1.8, 16.0, 25.0, False),
    ("plastic, two", "duet", 50.0, 4.0, 20.0, 20.0, True),
)
TASKS: Final = tuple(
    Task(
        name=name,
        form=form,
        efl_mm=efl_mm,
        f_number=f_number,
        half_field_deg=half_field_deg,
        min_bfl_mm=min_bfl_mm,
        aspheric=aspheric,
    )
    for name, form, efl_mm, f_number, half_field_deg, min_bfl_mm, aspheric in _ROWS
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run of one arm.

    Attributes:
        task: Its name.
        arm: One of `ARMS`.
        seed: Of the draws.
        spot_um: RMS over fields and colours, limits counted; inf where nothing was found.
        start: Built-in lens that the best end began at; empty for a drawn one.
        rounds: Searches that were finished.
        cpu_s: That they took.
    """

    task: str
    arm: str
    seed: int
    spot_um: float
    start: str
    rounds: int
    cpu_s: float


def problem_of(task: Task) -> Problem:
    """Return the problem of a task; its lens has the form, and numbers in the middle."""
    form, efl_mm = find_lens(task.form), task.efl_mm
    free = FreeLens(
        lens=_blank(form, task),
        variables=_variables(form, task),
        solved=refracting_surfaces(form)[-1],
        efl_mm=efl_mm,
    )
    corner = math.tan(to_radians(task.half_field_deg))
    return Problem(
        free=free,
        slopes=corner * torch.linspace(0, 1, _FIELDS, dtype=torch.float64).sqrt(),
        wavelengths_um=torch.tensor(_WAVES_UM, dtype=torch.float64),
        limits=Limits(
            distortion=0.05,
            min_edge_mm=_EDGE * efl_mm,
            min_air_mm=_AIR[0] * efl_mm,
            min_bfl_mm=task.min_bfl_mm,
            max_curvature_per_mm=_CURVATURE / efl_mm,
        ),
        merit="rms",
    )


def _blank(form: Lens, task: Task) -> Lens:
    middle_mm = {True: sum(_AIR) / 2 * task.efl_mm, False: sum(_GLASS) / 2 * task.efl_mm}
    surfaces = tuple(
        replace(
            surface,
            curvature_per_mm=0.0,
            thickness_mm=middle_mm[surface.glass == "air"],
            conic=0.0,
            even_asphere=(),
            semi_diameter_mm=math.inf,
        )
        for surface in form.surfaces
    )
    return replace(
        form,
        name="blank",
        surfaces=surfaces,
        aperture_kind="f_number",
        aperture_value=task.f_number,
        object_distance_mm=math.inf,
        reference_wavelength_um=_WAVES_UM[1],
    )


def _variables(form: Lens, task: Task) -> tuple[Variable, ...]:
    efl_mm, surfaces = task.efl_mm, refracting_surfaces(form)
    bend = _CURVATURE / efl_mm
    free = [Variable(kind="curvature", surface=i, low=-bend, high=bend) for i in surfaces[:-1]]
    for i, surface in enumerate(form.surfaces[:-1]):
        low, high = _AIR if surface.glass == "air" else _GLASS
        free.append(Variable(kind="thickness", surface=i, low=low * efl_mm, high=high * efl_mm))
    if task.aspheric:
        for i in surfaces:
            free.append(Variable(kind="conic", surface=i, low=_CONIC[0], high=_CONIC[1]))
            for term in range(1, _TERMS + 1):
                reach_mm = _REACH_SHARE * efl_mm
                most = _SAG_SHARE * efl_mm / reach_mm ** (2 * term + 2)
                free.append(
                    Variable(kind="even_asphere", surface=i, term=term, low=-most, high=most)
                )
    shift_mm = 0.02 * efl_mm
    return (*free, Variable(kind="defocus", low=-shift_mm, high=shift_mm))


def run_search(task: Task, arm: str, seed: int, seconds: float) -> Run:
    """Return what rounds of a search find in some CPU seconds; a round that began is finished."""
    problem = problem_of(task)
    begun_s = time.process_time()
    best_um, start, rounds = math.inf, "", 0
    for spot_um, name in _rounds(task, problem, arm, seed):
        rounds += 1
        if spot_um < best_um:
            best_um, start = spot_um, name
        if time.process_time() - begun_s >= seconds:
            break
    return Run(
        task=task.name,
        arm=arm,
        seed=seed,
        spot_um=best_um,
        start=start,
        rounds=rounds,
        cpu_s=round(time.process_time() - begun_s, 1),
    )


def _rounds(task: Task, problem: Problem, arm: str, seed: int) -> Iterator[tuple[float, str]]:
    """Yield the RMS spot in um and the origin of every round."""
    elements = sum(surface.glass != "air" for surface in problem.free.lens.surfaces)
    for number in range(1000):
        starts = Starts(count=16, merit="rms", seed=1000 * seed + number)
        try:
            if arm == RANDOM:
                plan = replace(starts, anywhere=1.0)
                yield _spot_um(problem, best_starts(problem, plan)[0]), ""
            else:
                plan = replace(starts, library=True, elements=elements, anywhere=0.5)
                left_out = (task.form, *_COPIES.get(task.form, ())) if arm == NO_FORM else ()
                best = library_starts(problem, plan, omit=left_out)[0]
                yield _spot_um(best.problem, best.scaled), best.name
        except ContractError:
            yield math.inf, ""


_COPIES: Final = {
    "cooke-triplet": ("cooke-triplet-f5",),
    "double-gauss": ("double-gauss-f2",),
    "duet": ("duet-joint",),
}


def _spot_um(problem: Problem, scaled: torch.Tensor) -> float:
    judging = replace(problem, samples=half_disc(_JUDGED_RAYS))
    with torch.no_grad():
        merit = float(residuals(judging, scaled[None]).square().sum())
    return 1000 * math.sqrt(merit) if math.isfinite(merit) else math.inf


def table_of(runs: list[Run]) -> str:
    """Return the table of success and median spot, one line for each task."""
    head = ["task", "best", *(f"{arm}: success, median" for arm in ARMS)]
    lines = [" | ".join(head), " | ".join("---" for _ in head)]
    totals = {arm: [0, 0] for arm in ARMS}
    for name in dict.fromkeys(run.task for run in runs):
        here = [run for run in runs if run.task == name]
        best_um = min(run.spot_um for run in here)
        cells = [name, f"{best_um:.1f} um"]
        for arm in ARMS:
            spots = sorted(run.spot_um for run in here if run.arm == arm)
            won = sum(spot <= SUCCESS_RATIO * best_um for spot in spots)
            totals[arm][0] += won
            totals[arm][1] += len(spots)
            middle = spots[len(spots) // 2] if spots else math.nan
            cells.append(f"{won}/{len(spots)}, {middle:.1f}")
        lines.append(" | ".join(cells))
    lines.append(" | ".join(["all", "", *(f"{won}/{count}" for won, count in totals.values())]))
    return "\n".join(f"| {line} |" for line in lines)


def main(say: Callable[[str], None] = print) -> None:
    """Run every arm of every task and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--tasks", type=str, default="")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    tasks = [task for task in TASKS if task.name.startswith(arguments.tasks)]
    runs: list[Run] = []
    for task in tasks:
        for seed in range(1, arguments.seeds + 1):
            seconds = arguments.seconds
            shipped = [run_search(task, arm, seed, seconds) for arm in (LIBRARY, NO_FORM)]
            # a round that began is finished, and one of the library is longer
            runs += [run_search(task, RANDOM, seed, max(seconds, shipped[0].cpu_s)), *shipped]
            say(", ".join(f"{r.spot_um:.1f} ({r.start}, {r.rounds})" for r in runs[-len(ARMS) :]))
        if arguments.output:
            _write(arguments.output, arguments.seconds, tasks, runs)
    say(table_of(runs))


def _write(path: Path, seconds: float, tasks: list[Task], runs: list[Run]) -> None:
    table = {
        "seconds": seconds,
        "tasks": [asdict(task) for task in tasks],
        "runs": [asdict(run) for run in runs],
    }
    path.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
