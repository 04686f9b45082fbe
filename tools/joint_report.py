"""Is a joint design better than the best lens that spots alone can find?

    python tools/joint_report.py models_def/recipes/duet_joint_lens.toml --data PICTURES \
        --fresh OTHERS --out-dir out/joint

Same start, same variables, same bounds. The lenses on spots, one a merit, are the best of descents
that trace ten times as many lenses as the joint design did, its own search included. The joint lens
is that of the recipe, or the one that `--joint` names. All are judged by the front alone on fresh
pictures, and so are the ends of the best eight descents of each merit. The start, the best lens on
spots and the joint lens are judged by networks of their own too, trained with the lens at rest and
the same budget for every seed. What is finished is kept in the folder and not done again: several
processes may share it, each with seeds of its own.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from camkit.models_def.design.assembly import find_lens, network_of, parts_of, problem_of
from camkit.models_def.design.loop import DesignLoop, DesignParts
from camkit.models_def.design.recipe import DesignRecipe, NetworkChoice, read_design
from camkit.models_def.design.score import at_lens, score_design
from camkit.models_def.design.starts import Starts, traced_lenses
from camkit.models_def.optics.lens_file.lens_file import write_lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.finish import finished
from camkit.models_def.optics.search.least_squares import descend, evaluations
from camkit.models_def.optics.search.merit import MERITS, Merit
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.training.pictures import SceneSource, open_source

Entry = dict[str, Any]

SPOT_RAYS = 24
CORE_MM = {"rms": 6e-3, "sum_abs": 6e-3, "energy": 3e-2}
SCOUT_STEPS, DLS_STEPS = 10, 80
KEPT_SHARE = 1 / 8
BATCH = 96
ENDS = 8


def main() -> None:
    arguments = parse()
    torch.set_num_threads(1)
    recipe = read_design(arguments.recipe)
    if arguments.network:
        recipe = replace(recipe, network=NetworkChoice(name=arguments.network, config={}))
    folder, out = arguments.recipe.parent, arguments.out_dir
    alone = replace(recipe, network=NetworkChoice(config={}), starts=Starts())
    parts = parts_of(alone, folder=folder, pictures=arguments.data)
    fresh = open_source(arguments.fresh, picture_share=1.0, scenes=1, scene_px=64)
    out.mkdir(parents=True, exist_ok=True)
    searched = traced_lenses(recipe.starts, len(recipe.variables))
    least = arguments.times * (searched + recipe.schedule.steps)
    lenses: dict[str, Tensor] = {"start": parts.lens.begin.clone()}
    for merit in MERITS:
        lenses[f"spots {merit}"] = kept_lens(
            out / f"spots_{merit}.json", lambda merit=merit: spots(parts, merit, least)
        )
    lenses["joint"] = (
        problem_of(alone, find_lens(arguments.joint, Path())).free.scaled()
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
        entry = kept(path, lambda ends=ends: judged_ends(parts, recipe, ends, fresh))
        report["lenses"][f"spots {merit}"]["ends"] = entry
        print(f"spots {merit}: ends of merit", *(f"{m:.3g}" for m in entry["merits"]))
        print(
            "    recovered by the front, dB", *(f"{db:.2f}" for db in entry["front_db"]), flush=True
        )
    best = max((n for n in lenses if n.startswith("spots")), key=lambda n: front_db(report, n))
    judged = ("start", best, "joint") if recipe.network.name else ()
    for seed, name in product(arguments.seeds, judged):
        entry = kept(
            out / f"{slug(name)}_network_{seed}.json",
            lambda name=name, seed=seed: network_score(
                parts, recipe, lenses[name], seed, arguments.network_steps, fresh
            ),
        )
        report["lenses"][name]["networks"].append(entry)
        print(f"seed {seed}:", line(name, report["lenses"][name]), flush=True)
    (out / "joint.json").write_text(json.dumps(report, indent=1))


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path)
    parser.add_argument("--data", type=Path, help="pictures to design and train on")
    parser.add_argument("--fresh", type=Path, help="pictures to judge on")
    parser.add_argument("--out-dir", type=Path, default=Path("out/joint"))
    parser.add_argument("--joint", help="a finished joint lens: a name or a file")
    parser.add_argument("--times", type=int, default=10, help="lenses that spots may trace more")
    parser.add_argument("--network", help="of the catalogue, in place of the recipe's")
    parser.add_argument("--network-steps", type=int, default=1000)
    parser.add_argument("--seeds", type=numbers, default=(1, 2, 3), help="of networks: 1,2,3")
    return parser.parse_args()


def numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(","))


def slug(name: str) -> str:
    return name.replace(" ", "_")


def front_db(report: Entry, name: str) -> float:
    return float(report["lenses"][name]["front_db"])


def kept(path: Path, make: Callable[[], Entry]) -> Entry:
    """Give what is in a file, or make it and keep it."""
    if not path.exists():
        begin = time.process_time()
        made = make()
        made["cpu_s"] = round(time.process_time() - begin, 1)
        path.write_text(json.dumps(made))
    found: Entry = json.loads(path.read_text())
    return found


def kept_lens(path: Path, make: Callable[[], Entry]) -> Tensor:
    return torch.tensor(kept(path, make)["scaled"], dtype=torch.float64)


def spots(parts: DesignParts, merit: Merit, least: int) -> Entry:
    """Give the best lens on spots: from the start itself, from near it, and from anywhere.

    Args:
        parts: What is free, and what is looked at.
        merit: Of the spots.
        least: Lenses to trace, at least.
    """
    problem = replace(
        parts.lens.problem, samples=half_disc(SPOT_RAYS), merit=merit, core_mm=CORE_MM[merit]
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
    return {
        "scaled": found[0].tolist(),
        "merit": float(merits[0]),
        "evaluations": starts * each,
        "ends": found[:ENDS].tolist(),
        "end_merits": merits[:ENDS].tolist(),
    }


def in_batches(problem: Problem, begin: Tensor, steps: int) -> tuple[Tensor, Tensor]:
    """Give (start, variable) descended lenses and their merits, best first."""
    held = problem.free.high <= problem.free.low
    ends = [
        descend(lambda s: residuals(problem, s), part, steps, held) for part in begin.split(BATCH)
    ]
    merits = torch.cat([end.merits for end in ends])
    order = merits.nan_to_num(torch.inf).argsort()
    return torch.cat([end.scaled for end in ends])[order], merits[order]


def judged_ends(parts: DesignParts, recipe: DesignRecipe, ends: Entry, fresh: SceneSource) -> Entry:
    """Give what the front makes of the lenses that the best descents ended at."""
    scores = [
        score_design(parts, recipe.schedule, torch.tensor(end, dtype=torch.float64), source=fresh)
        for end in ends["ends"]
    ]
    return {"merits": ends["end_merits"], "front_db": [score.psnr_db for score in scores]}


def joint(recipe: DesignRecipe, folder: Path, pictures: Path | None) -> Entry:
    """Give the lens of the recipe's own joint design."""
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
    networks = [n["psnr_db"] for n in entry["networks"] if n]
    seen = f"{np.mean(networks):.2f} +- {np.std(networks):.2f}" if networks else "-"
    return f"{name:28} front {entry['front_db']:.2f} dB, network {seen} dB"


if __name__ == "__main__":
    main()
