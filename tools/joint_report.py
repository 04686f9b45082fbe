"""Is a joint design better than the best lens that spots alone can find?

    python -m tools.joint_report models_def/recipes/duet_joint_lens.toml --data PICTURES \
        --fresh OTHERS --out-dir out/joint

Same start, same variables, same bounds. The lenses on spots, one a merit, are the best of descents
that trace ten times as many lenses as the joint design did, its own search included. The joint lens
is that of the recipe, or the one that `--joint` names. All are judged by the front alone on fresh
pictures, and so are eight different ends of the best descents of each merit. The start, the best
lens on spots and the joint lens are judged by networks of their own too, trained with the lens at
rest and the same budget for every seed. What is finished is kept in the folder and not done again:
once the lenses are there, several processes may share it, each with seeds of its own.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.assembly import network_of, parts_of, problem_of
from camkit.models_def.design.loop import DesignLoop, DesignParts
from camkit.models_def.design.recipe import (
    DesignRecipe,
    NetworkChoice,
    read_design,
    recipe_digest,
)
from camkit.models_def.design.starts import Starts, traced_lenses
from camkit.models_def.optics.lens_file.lens_file import find_lens, write_lens
from camkit.models_def.optics.prescription import Surface
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.finish import finished
from camkit.models_def.optics.search.least_squares import descend, evaluations
from camkit.models_def.optics.search.merit import MERITS, Merit
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.training.pictures import SceneSource, open_source
from tools.design.score import at_lens, score_design

Entry = dict[str, Any]

SPOT_RAYS = 24
CORE_MM = {"rms": 6e-3, "sum_abs": 6e-3, "energy": 3e-2}
SCOUT_STEPS, DLS_STEPS = 10, 80
KEPT_SHARE = 1 / 8
BATCH = 96
ENDS = 8
OTHER = 0.1
SAME = 1e-4
RIM_MM = 8.0
ASPHERE_TERMS = 8


def main() -> None:
    """Find the lenses, judge them and write the report."""
    arguments = parse()
    torch.set_num_threads(1)
    recipe = read_design(arguments.recipe)
    judges = judges_of(recipe, arguments.network)
    folder, out = arguments.recipe.parent, arguments.out_dir
    alone = replace(recipe, network=NetworkChoice(config={}), starts=Starts())
    parts = parts_of(alone, folder=folder, pictures=arguments.data)
    # one window for all: equal windows give equal patches
    one = replace(recipe.pixels, kernel_px=parts.lens.pixels.kernel_px)
    recipe, alone = replace(recipe, pixels=one), replace(alone, pixels=one)
    fresh = open_source(arguments.fresh, picture_share=1.0, scenes=1, scene_px=64)
    out.mkdir(parents=True, exist_ok=True)
    refuse_other_settings(recipe, judges, arguments)
    searched = traced_lenses(recipe.starts, len(recipe.variables))
    least = arguments.times * (searched + recipe.schedule.steps)
    lenses: dict[str, Tensor] = {"start": parts.lens.begin.clone()}
    for merit in MERITS:
        lenses[f"spots {merit}"] = kept_lens(
            out / f"spots_{merit}.json",
            partial(spots, parts, merit, core_mm(recipe.starts, merit), least),
        )
    lenses["joint"] = (
        given_lens(alone, parts, arguments.joint)
        if arguments.joint
        else kept_lens(out / "joint_lens.json", lambda: joint(recipe, folder, arguments.data))
    )
    report: dict[str, Any] = {"recipe": recipe.name, "joint_evaluations": least // arguments.times}
    report["lenses"] = {}
    for name, scaled in lenses.items():
        write_lens(finished(parts.lens.problem, scaled), out / f"{slug(name)}.toml")
        found = score_design(parts, recipe.schedule, scaled, source=fresh)
        entry = {"front_db": found.psnr_db, "front_by_field_db": found.by_field_db}
        report["lenses"][name] = entry | {"networks": []}
        print(line(name, report["lenses"][name]), flush=True)
    for merit in MERITS:
        path = out / f"spots_{merit}_ends.json"
        ends = json.loads((out / f"spots_{merit}.json").read_text())
        ended = kept(path, partial(judged_ends, parts, recipe, ends, fresh))
        report["lenses"][f"spots {merit}"]["ends"] = ended
        print(f"spots {merit}: ends of merit", *(f"{m:.3g}" for m in ended["merits"]))
        print(
            "    recovered by the front, dB", *(f"{db:.2f}" for db in ended["front_db"]), flush=True
        )
    best = max((n for n in lenses if n.startswith("spots")), key=lambda n: front_db(report, n))
    judged = ("start", best, "joint") if judges.name else ()
    for seed, name in product(arguments.seeds, judged):
        entry = kept(
            network_file(out, name, seed),
            partial(
                network_score,
                parts,
                replace(recipe, network=judges),
                lenses[name],
                seed,
                arguments.network_steps,
                fresh,
            ),
        )
        print(f"seed {seed}: {name}: {entry['psnr_db']:.2f} dB", flush=True)
    for name in judged:
        # those of other processes too
        made = sorted(out.glob(network_file(Path(), name, "*").name))
        report["lenses"][name]["networks"] = [json.loads(path.read_text()) for path in made]
        print(line(name, report["lenses"][name]))
    written(out / "joint.json", json.dumps(report, indent=1))


def judges_of(recipe: DesignRecipe, name: str | None) -> NetworkChoice:
    """Return the network that judges: the recipe's, another one, or none."""
    if name is None:
        return recipe.network
    return NetworkChoice(name="" if name == "none" else name, config={})


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path)
    parser.add_argument("--data", type=Path, help="pictures to design and train on")
    parser.add_argument("--fresh", type=Path, help="pictures to judge on")
    parser.add_argument("--out-dir", type=Path, default=Path("out/joint"))
    parser.add_argument("--joint", help="a finished joint lens: a name or a file")
    parser.add_argument("--times", type=int, default=10, help="lenses that spots may trace more")
    parser.add_argument("--network", help="that judges, in place of the recipe's; or none")
    parser.add_argument("--network-steps", type=int, default=1000)
    parser.add_argument("--seeds", type=numbers, default=(1, 2, 3), help="of networks: 1,2,3")
    return parser.parse_args()


def numbers(text: str) -> tuple[int, ...]:
    """Read numbers with commas between."""
    return tuple(int(part) for part in text.split(","))


def slug(name: str) -> str:
    """Return a name as it stands in a file name."""
    return name.replace(" ", "_")


def front_db(report: Entry, name: str) -> float:
    """Return what the front alone reaches with a lens."""
    return float(report["lenses"][name]["front_db"])


def kept(path: Path, make: Callable[[], Entry]) -> Entry:
    """Return what is in a file, or make it and keep it."""
    if not path.exists():
        begin = time.process_time()
        made = make()
        made["cpu_s"] = round(time.process_time() - begin, 1)
        written(path, json.dumps(made))
    found: Entry = json.loads(path.read_text())
    return found


def written(path: Path, text: str) -> None:
    """Write a file that appears complete or not at all."""
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    part.replace(path)


def network_file(out: Path, name: str, seed: int | str) -> Path:
    """Name the file of a trained network."""
    return out / f"{slug(name)}_network_{seed}.json"


def refuse_other_settings(
    recipe: DesignRecipe, judges: NetworkChoice, arguments: argparse.Namespace
) -> None:
    """Keep what the folder's results depend on; raise ContractError where it is another."""
    path: Path = arguments.out_dir / "settings.json"
    asked = {
        "recipe": recipe_digest(recipe),
        "network": judges.name,
        "network_steps": arguments.network_steps,
        "times": arguments.times,
        "joint": arguments.joint,
        "data": str(arguments.data),
        "fresh": str(arguments.fresh),
    }
    if not path.exists():
        written(path, json.dumps(asked))
    elif json.loads(path.read_text()) != asked:
        raise ContractError(f"{path} belongs to other settings; give another --out-dir")


def given_lens(recipe: DesignRecipe, parts: DesignParts, name: str) -> Tensor:
    """Return the numbers of a finished lens; raises ContractError if the recipe cannot make it."""
    lens = find_lens(name, Path())
    problem = problem_of(recipe, lens)
    scaled = problem.free.scaled()
    made = parts.lens.problem.free.made(scaled)
    pairs = zip(made.surfaces, lens.surfaces, strict=False)
    same = len(made.surfaces) == len(lens.surfaces) and all(
        one.glass == other.glass and np.allclose(shape(one), shape(other), rtol=SAME, atol=SAME)
        for one, other in pairs
    )
    if not same:
        raise ContractError(f"{lens.name} is no lens that {recipe.name} can become")
    return scaled


def shape(surface: Surface) -> list[float]:
    """Return what light meets, in numbers of the order of 1."""
    terms = [*surface.even_asphere, *[0.0] * ASPHERE_TERMS][:ASPHERE_TERMS]
    bends = [a * RIM_MM ** (2 * j) for j, a in enumerate(terms, start=1)]
    return [surface.curvature_per_mm * RIM_MM, surface.conic, surface.thickness_mm, *bends]


def kept_lens(path: Path, make: Callable[[], Entry]) -> Tensor:
    """Return the numbers of a lens from its file, or find it."""
    return torch.tensor(kept(path, make)["scaled"], dtype=torch.float64)


def spots(parts: DesignParts, merit: Merit, core_mm: float, least: int) -> Entry:
    """Return the best lens on spots: from the start itself, from near it, and from anywhere.

    Args:
        parts: What is free, and what is looked at.
        merit: Of the spots.
        core_mm: Its core.
        least: Lenses to trace, at least.
    """
    problem = replace(
        parts.lens.problem, samples=half_disc(SPOT_RAYS), merit=merit, core_mm=core_mm
    )
    variables = len(problem.free.variables)
    each = evaluations(1, SCOUT_STEPS, variables)
    each += round(KEPT_SHARE * evaluations(1, DLS_STEPS, variables))
    starts = max(8, -(-least // each))
    rng = np.random.default_rng(11)
    drawn = torch.from_numpy(rng.uniform(0, 1, (starts, variables)))
    near = parts.lens.begin + torch.from_numpy(rng.uniform(-0.1, 0.1, drawn.shape))
    drawn[1 : starts // 2] = near[1 : starts // 2].clamp(0, 1)
    drawn[0] = parts.lens.begin
    scouted, _ = in_batches(problem, drawn, SCOUT_STEPS)
    found, merits = in_batches(problem, scouted[: max(1, round(KEPT_SHARE * starts))], DLS_STEPS)
    ends = distinct(found)
    return {
        "scaled": found[0].tolist(),
        "merit": float(merits[0]),
        "evaluations": evaluations(starts, SCOUT_STEPS, variables)
        + evaluations(len(found), DLS_STEPS, variables),
        "ends": found[ends].tolist(),
        "end_merits": merits[ends].tolist(),
    }


def core_mm(starts: Starts, merit: Merit) -> float:
    """Return the core of a merit: that of the recipe's search where it has the same merit."""
    own_mm = starts.core_um / 1000
    return own_mm if starts.merit == merit and own_mm else CORE_MM[merit]


def distinct(lenses: Tensor) -> list[int]:
    """Return the first few of (start, variable) that differ from each other in some number."""
    chosen: list[int] = []
    for i, scaled in enumerate(lenses):
        if all(float((scaled - lenses[j]).abs().max()) > OTHER for j in chosen):
            chosen.append(i)
        if len(chosen) == ENDS:
            break
    return chosen


def in_batches(problem: Problem, begin: Tensor, steps: int) -> tuple[Tensor, Tensor]:
    """Return (start, variable) descended lenses and their merits, best first."""
    held = problem.free.high <= problem.free.low
    ends = [
        descend(lambda s: residuals(problem, s), part, steps, held)
        for part in torch.split(begin, BATCH)
    ]
    merits = torch.cat([end.merits for end in ends])
    order = merits.nan_to_num(torch.inf).argsort()
    return torch.cat([end.scaled for end in ends])[order], merits[order]


def judged_ends(parts: DesignParts, recipe: DesignRecipe, ends: Entry, fresh: SceneSource) -> Entry:
    """Return what the front makes of the lenses that the best descents ended at."""
    scores = [
        score_design(parts, recipe.schedule, torch.tensor(end, dtype=torch.float64), source=fresh)
        for end in ends["ends"]
    ]
    return {"merits": ends["end_merits"], "front_db": [score.psnr_db for score in scores]}


def joint(recipe: DesignRecipe, folder: Path, pictures: Path | None) -> Entry:
    """Return the lens of the recipe's own joint design."""
    loop = DesignLoop(parts_of(recipe, folder=folder, pictures=pictures), recipe.schedule)
    curve = [loop.judge().valid_db] + [moment.valid_db for moment in loop.run()]
    loop.take_best()
    return {"scaled": loop.parts.lens.scaled().detach().tolist(), "curve": curve}


def network_score(
    parts: DesignParts,
    recipe: DesignRecipe,
    scaled: Tensor,
    seed: int,
    steps: int,
    fresh: SceneSource,
) -> Entry:
    """Train a network of its own for a lens at rest, and judge it on fresh pictures."""
    schedule = replace(
        recipe.schedule, steps=steps, lens_rate=0.0, seed=seed, epoch_steps=max(1, steps // 12)
    )
    network = network_of(replace(recipe, schedule=schedule))
    loop = DesignLoop(replace(at_lens(parts, scaled, rays=1500), network=network), schedule)
    for _ in loop.run():
        pass
    loop.take_best()
    found = score_design(parts, schedule, scaled, source=fresh, network=network)
    return {"psnr_db": found.psnr_db, "by_field_db": found.by_field_db}


def line(name: str, entry: Entry) -> str:
    """Return the line of a lens for people."""
    networks = [n["psnr_db"] for n in entry["networks"] if n]
    seen = f"{np.mean(networks):.2f} +- {np.std(networks):.2f}" if networks else "-"
    return f"{name:28} front {entry['front_db']:.2f} dB, network {seen} dB"


if __name__ == "__main__":
    main()
