"""How far off may a start be? The same disturbed lenses designed in several ways.

    python -m tools.design_stability models_def/recipes/lfov_joint.toml \
        --data PICTURES --fresh OTHERS --out-dir out/stability

Every curvature of the recipe's lens is multiplied by 1 + u, u uniform within a level, and the
sensor is moved by up to +- 2 mm. From each such start the design runs for the same number of
steps (as many as fit into `--minutes` of CPU on this machine, or `--steps`), in every arm; the
search of an arm comes on top:

before      plain steps in the lens's own numbers, focal length free, sensor where it stands, no
            limits
spots       focal length solved, sensor riding on the image, limits, whitened moves, the best of
            eight lenses near the start by damped least squares, spots judging
after       the same with the recipe's own search: more lenses, from further off, judged by what
            is recovered
curriculum  as after, opened from part of the aperture and field to the whole step by step

The best three of each arm run to the recipe's end. Every lens is judged by the Wiener front on
fresh pictures. What is finished is kept in `trials.jsonl` and not done again.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of, source_of
from camkit.models_def.design.front import Front
from camkit.models_def.design.loop import DesignLoop, DesignParts, DesignSchedule
from camkit.models_def.design.optics import LensModule
from camkit.models_def.design.recipe import DesignRecipe, NetworkChoice, read_design, recipe_digest
from camkit.models_def.design.starts import Starts, disturbed
from camkit.models_def.optics.lens_file.lens_file import find_lens, write_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.problem import Problem, limits_of, trace_batch, valid_share
from camkit.models_def.optics.search.variables import Variable
from camkit.models_def.training.pictures import SceneSource, open_source
from camkit.report.journal import append_journal, read_journal
from tools.design.score import score_design
from tools.design.stability_chart import Rules, Trial, best_trials, to_text, write_stability

LEVELS: Final = (0.05, 0.1, 0.2, 0.5)
FOCUS_MM: Final = 2.0
OPENINGS: Final = {
    "before": (1.0,),
    "spots": (1.0,),
    "after": (1.0,),
    "curriculum": (0.4, 0.7, 1.0),
}
PLAIN_FOCUS_MM: Final = 10.0
JUDGE_RAYS: Final = 1000
SPOTS_STARTS: Final = Starts(count=8)
WHITENED_RATE: Final = 0.1
WARM_STEPS, TIMED_STEPS = 4, 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """What all trials share.

    Attributes:
        recipe: Without a network.
        folder: Of the recipe.
        out_dir: Of the results.
        pictures: To design on, opened once for all.
        fresh: To judge on.
        plain_rate: Learning rate of the plain arm, in shares of the bounds.
        seed: Of the starts.
    """

    recipe: DesignRecipe
    folder: Path
    out_dir: Path
    pictures: SceneSource
    fresh: SceneSource
    plain_rate: float
    seed: int

    @property
    def lens(self) -> Lens:
        """Return the lens that is disturbed."""
        return find_lens(self.recipe.prescription, self.folder)

    @property
    def efl_mm(self) -> float:
        """Return the focal length that is wanted."""
        return self.recipe.optics.efl_mm or paraxial_data(self.lens).efl_mm

    def of_arm(self, arm: str) -> DesignRecipe:
        """Return the recipe of an arm."""
        solved = self.recipe.optics.solved_surface % len(self.lens.surfaces)
        if arm == "before":
            return plain(self.recipe, solved, self.plain_rate)
        own = steady(self.recipe, solved, self.efl_mm)
        return replace(own, starts=SPOTS_STARTS) if arm == "spots" else own

    def parts(self, arm: str, number: int, *, search: bool = True) -> DesignParts:
        """Return the parts of an arm at a disturbed lens, the same one for every arm."""
        path = (self.out_dir / "starts" / f"{number:02}.toml").resolve()
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            rng = np.random.default_rng([self.seed, number])
            share = level_of(number)
            write_lens(disturbed(self.lens, rng, curvature_share=share, focus_mm=FOCUS_MM), path)
        recipe = replace(self.of_arm(arm), prescription=str(path))
        recipe = recipe if search else replace(recipe, starts=Starts())
        return parts_of(recipe, folder=self.folder, source=self.pictures)


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Which design a lens comes from, and what it took."""

    arm: str
    number: int
    run: str
    cpu_s: float


def main() -> None:
    """Run what is missing of the trial and report it."""
    arguments = parse()
    torch.set_num_threads(1)
    bench = bench_of(arguments)
    bench.out_dir.mkdir(parents=True, exist_ok=True)
    steps = agreed_steps(bench, arguments)
    arms = tuple(arguments.arms.split(","))
    rules = Rules(
        efl_mm=bench.efl_mm,
        within_db=arguments.within_db,
        within_mm=arguments.within_mm,
    )
    done = read_journal(bench.out_dir / "trials.jsonl", to_trial, "trial of a stability run")
    known = {(t.arm, t.number, t.run) for t in done}
    for number in range(arguments.starts):
        for arm in arms:
            if (arm, number, "box") not in known:
                done.append(kept(bench, from_start(bench, arm, number, steps)))
    for arm in arms:
        for trial in best_trials(done, rules, arm, arguments.finalists):
            if (arm, trial.number, "end") not in known:
                done.append(kept(bench, to_the_end(bench, trial)))
    facts = {"recipe": bench.recipe.name, "steps": steps, **asdict(rules)}
    files = write_stability(done, rules, facts, bench.out_dir)
    print(to_text(done, rules), *(str(path) for path in files), sep="\n")


def kept(bench: Bench, trial: Trial) -> Trial:
    """Write a finished trial down and print it."""
    append_journal(bench.out_dir / "trials.jsonl", [asdict(trial)])
    print(
        f"{trial.number:2} {trial.arm:10} {100 * trial.level:.0f} % {trial.run}: "
        f"{trial.front_db:.2f} dB, rays {trial.valid_rays:.3f}, EFL {trial.efl_mm:.2f} mm, "
        f"limits {trial.limits_cost:.3g}, {trial.cpu_s:.0f} CPU-s",
        file=sys.stderr,
        flush=True,
    )
    return trial


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recipe", type=Path)
    parser.add_argument("--out-dir", type=Path, default=Path("out/stability"))
    parser.add_argument("--data", type=Path, help="pictures to design on")
    parser.add_argument("--fresh", type=Path, help="pictures to judge on")
    parser.add_argument("--arms", default="before,after", help=", ".join(OPENINGS))
    parser.add_argument("--starts", type=int, default=32, help="in all, spread over the levels")
    parser.add_argument("--minutes", type=float, default=3.0, help="CPU time of a start")
    parser.add_argument("--steps", type=int, default=0, help="of a start, instead of --minutes")
    parser.add_argument("--finalists", type=int, default=3, help="of an arm, that run to the end")
    parser.add_argument("--plain-rate", type=float, default=0.001)
    parser.add_argument("--within-db", type=float, default=0.5, help="of the best: a success")
    parser.add_argument("--within-mm", type=float, default=0.5, help="of the focal length")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    unknown = set(arguments.arms.split(",")) - set(OPENINGS)
    if unknown:
        parser.error(f"--arms takes {', '.join(OPENINGS)}; got {', '.join(sorted(unknown))}")
    return arguments


def bench_of(arguments: argparse.Namespace) -> Bench:
    """Return what all trials share."""
    recipe = replace(read_design(arguments.recipe), network=NetworkChoice(config={}))
    if recipe.loss.needs_network and recipe.front.kind != "wiener":
        recipe = replace(recipe, front=Front(kind="wiener"))
    if not recipe.pixels.kernel_px:
        # the window of the lens as it should be, for all: equal windows give equal patches
        window = parts_of(recipe, folder=arguments.recipe.parent).lens.pixels.kernel_px
        recipe = replace(recipe, pixels=replace(recipe.pixels, kernel_px=window))
    return Bench(
        recipe=recipe,
        folder=arguments.recipe.parent,
        out_dir=arguments.out_dir,
        pictures=source_of(recipe, arguments.data),
        fresh=open_source(
            arguments.fresh,
            picture_share=1.0,
            scenes=recipe.data.procedural_scenes,
            scene_px=recipe.data.scene_px,
        ),
        plain_rate=arguments.plain_rate,
        seed=arguments.seed,
    )


def agreed_steps(bench: Bench, arguments: argparse.Namespace) -> int:
    """Return the steps of every trial: those of an earlier run in this folder, or measured now."""
    path = arguments.out_dir / "settings.json"
    asked = {
        "digest": recipe_digest(bench.recipe),
        "minutes": arguments.minutes,
        "asked_steps": arguments.steps,
        "plain_rate": arguments.plain_rate,
        "data": str(arguments.data),
        "fresh": str(arguments.fresh),
        "seed": arguments.seed,
    }
    if path.exists():
        found = json.loads(path.read_text(encoding="utf-8"))
        steps = int(found.pop("steps"))
        if found != asked:
            raise ContractError(f"{path} belongs to other settings; give another --out-dir")
        return steps
    steps = arguments.steps or measured_steps(bench, arguments.minutes)
    path.write_text(json.dumps({**asked, "steps": steps}), encoding="utf-8")
    return steps


def measured_steps(bench: Bench, minutes: float) -> int:
    """Return the steps that fit into so many minutes of CPU, by a few of them."""
    plan = short(bench.recipe.schedule, WARM_STEPS + TIMED_STEPS)
    loop = DesignLoop(bench.parts("after", 0), replace(plan, valid_steps=TIMED_STEPS // 2))
    for _ in loop.run(WARM_STEPS):
        pass
    begin = time.process_time()
    for _ in loop.run():
        pass
    spent_s = time.process_time() - begin
    return max(1, round(minutes * 60 * TIMED_STEPS / spent_s))


def short(schedule: DesignSchedule, steps: int) -> DesignSchedule:
    """Return a schedule of so many steps that decays and validates as often as the whole one."""
    share = steps / schedule.steps
    return replace(
        schedule,
        steps=steps,
        epoch_steps=max(1, round(schedule.epoch_steps * share)),
        valid_steps=max(1, round(schedule.valid_steps * share)),
        hold_steps=0,
        freeze_share=0.0,
    )


def plain(recipe: DesignRecipe, solved: int, rate: float) -> DesignRecipe:
    """Return a recipe with every number free in its own scale, no solve, no limits, no search."""
    optics, steepest = recipe.optics, recipe.limits.max_curvature_per_mm
    own = [v for v in recipe.variables if v.kind != "defocus"]
    if optics.efl_mm:
        own.append(Variable(kind="curvature", surface=solved, low=-steepest, high=steepest))
    own.append(Variable(kind="defocus", low=-PLAIN_FOCUS_MM, high=PLAIN_FOCUS_MM))
    return replace(
        recipe,
        variables=tuple(own),
        optics=replace(optics, efl_mm=0.0, rides=False, whiten=False, units="range"),
        schedule=replace(recipe.schedule, lens_rate=rate, penalty_weight=0.0),
        starts=Starts(),
    )


def steady(recipe: DesignRecipe, solved: int, efl_mm: float) -> DesignRecipe:
    """Return a recipe with all that keeps a design from going astray, where it has not."""
    optics, schedule = recipe.optics, recipe.schedule
    return replace(
        recipe,
        variables=tuple(
            v for v in recipe.variables if (v.kind, v.surface) != ("curvature", solved)
        ),
        optics=replace(optics, efl_mm=efl_mm, rides=True, whiten=True, units="range"),
        schedule=schedule if optics.whiten else replace(schedule, lens_rate=WHITENED_RATE),
        starts=recipe.starts if recipe.starts.count else SPOTS_STARTS,
    )


def level_of(number: int) -> float:
    """Return the level of a start: they take turns."""
    return LEVELS[number % len(LEVELS)]


def to_trial(entry: Mapping[str, Any]) -> Trial:
    """Read a trial from its line."""
    return Trial(**{**entry, "scaled": tuple(entry["scaled"])})


def from_start(bench: Bench, arm: str, number: int, steps: int) -> Trial:
    """Design from one disturbed lens for so many steps, aperture and field opened in turn."""
    begin = time.process_time()
    parts, recipe, shares = bench.parts(arm, number), bench.of_arm(arm), OPENINGS[arm]
    plan = short(recipe.schedule, max(1, steps // len(shares)))
    whole, scaled = parts.lens.problem, parts.lens.scaled().detach()
    for share in shares:
        samples = replace(whole.samples, x=whole.samples.x * share, y=whole.samples.y * share)
        part = replace(whole, slopes=whole.slopes * share, samples=samples)
        scaled = descended(parts, part, scaled, plan, whiten=recipe.optics.whiten)
    found = Found(arm=arm, number=number, run="box", cpu_s=time.process_time() - begin)
    return judged(bench, parts, scaled, found)


def to_the_end(bench: Bench, trial: Trial) -> Trial:
    """Go on from where a trial came to, with the whole schedule of the recipe."""
    begin = time.process_time()
    parts = bench.parts(trial.arm, trial.number, search=False)
    recipe = bench.of_arm(trial.arm)
    given = torch.tensor(trial.scaled, dtype=torch.float64)
    schedule = short(recipe.schedule, recipe.schedule.steps)
    scaled = descended(parts, parts.lens.problem, given, schedule, whiten=recipe.optics.whiten)
    cpu_s = time.process_time() - begin
    found = Found(arm=trial.arm, number=trial.number, run="end", cpu_s=cpu_s)
    return judged(bench, parts, scaled, found)


def descended(
    parts: DesignParts, problem: Problem, begin: Tensor, schedule: DesignSchedule, *, whiten: bool
) -> Tensor:
    """Return the best lens of a loop from `begin`, scaled."""
    lens = LensModule(problem, parts.lens.pixels, begin, whiten=whiten)
    loop = DesignLoop(replace(parts, lens=lens), schedule)
    loop.judge()
    for _ in loop.run():
        pass
    loop.take_best()
    return lens.scaled().detach()


def judged(bench: Bench, parts: DesignParts, scaled: Tensor, found: Found) -> Trial:
    """Judge a lens on fresh pictures by the Wiener front, and count its rays."""
    front = parts.front if parts.front.kind == "wiener" else Front(kind="wiener")
    score = score_design(
        replace(parts, front=front), bench.recipe.schedule, scaled, source=bench.fresh
    )
    problem = replace(parts.lens.problem, samples=half_disc(JUDGE_RAYS), limits=bench.recipe.limits)
    traced = trace_batch(problem, scaled[None], problem.limited_mm)
    broken = limits_of(problem, traced, problem.limited_mm).square().sum()
    return Trial(
        arm=found.arm,
        number=found.number,
        level=level_of(found.number),
        run=found.run,
        scaled=tuple(scaled.tolist()),
        front_db=score.psnr_db,
        valid_rays=float(valid_share(problem, scaled[None])),
        efl_mm=paraxial_data(problem.free.made(scaled)).efl_mm,
        limits_cost=float(broken),
        cpu_s=round(found.cpu_s, 1),
    )


if __name__ == "__main__":
    main()
