"""Is a joint design better than the best lens that spots alone can find?

    python tools/joint_report.py models_def/recipes/duet_joint_lens.toml --data PICTURES \
        --fresh OTHERS --out-dir out/joint

Same start, same variables, same bounds. The spots lenses (every merit, many starts) may trace ten
times as many lenses as the joint design; the joint design begins at the best of them and, apart
from it, at the recipe's lens. Every lens is then judged by the front alone on fresh pictures; the
start, the best lens on spots and the best joint lens also by networks of their own, trained with
the lens at rest and the same budget for every seed. What is finished is kept in the folder and not
done again: several processes may share it, each with seeds of its own.
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

from camkit.models_def.design.assembly import network_of, parts_of
from camkit.models_def.design.loop import DesignLoop, DesignParts
from camkit.models_def.design.optics import LensModule
from camkit.models_def.design.recipe import DesignRecipe, NetworkChoice, read_design
from camkit.models_def.design.score import at_lens, score_design
from camkit.models_def.optics.lens_file.lens_file import write_lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.finish import finished
from camkit.models_def.optics.search.least_squares import descend
from camkit.models_def.optics.search.merit import MERITS, Merit
from camkit.models_def.optics.search.problem import residuals
from camkit.models_def.training.pictures import SceneSource, open_source

SPOT_RAYS = 24
CORE_MM = {"rms": 6e-3, "sum_abs": 6e-3, "energy": 3e-2}


def main() -> None:
    arguments = parse()
    torch.set_num_threads(1)
    recipe = read_design(arguments.recipe)
    if arguments.network:
        choice = NetworkChoice(name=arguments.network, config={})
        recipe = replace(recipe, network=choice)
    alone = replace(recipe, network=NetworkChoice(config={}))
    parts = parts_of(alone, folder=arguments.recipe.parent, pictures=arguments.data)
    fresh = open_source(arguments.fresh, picture_share=1.0, scenes=1, scene_px=64)
    arguments.out_dir.mkdir(parents=True, exist_ok=True)
    lenses: dict[str, Tensor] = {"start": parts.lens.begin.clone()}
    report: dict[str, Any] = {"recipe": recipe.name, "lenses": {}}
    for merit in MERITS:
        lenses[f"spots {merit}"] = kept(
            arguments.out_dir / f"spots_{merit}.json",
            lambda merit=merit: spots(parts, merit, arguments.starts, arguments.spot_steps),
        )
    best = max(
        (name for name in lenses if name.startswith("spots")),
        key=lambda name: front_db(parts, recipe, lenses[name], fresh),
    )
    for name, begin in (
        ("joint from start", lenses["start"]),
        (f"joint from {best}", lenses[best]),
    ):
        path = arguments.out_dir / f"{name.replace(' ', '_')}.json"
        lenses[name] = kept(path, lambda begin=begin: joint(parts, alone, begin))
    for name, scaled in lenses.items():
        lens = finished(parts.lens.problem, scaled)
        write_lens(lens, arguments.out_dir / f"{name.replace(' ', '_')}.toml")
        found = score_design(parts, recipe.schedule, scaled, source=fresh)
        entry = {"front_db": found.psnr_db, "front_by_field_db": found.by_field_db}
        report["lenses"][name] = entry | {"networks": []}
        print(line(name, report["lenses"][name]), flush=True)
    judged = ["start", best, best_of(report, "joint")]
    for seed, name in product(arguments.seeds if arguments.network else (), judged):
        path = arguments.out_dir / f"{name.replace(' ', '_')}_network_{seed}.json"
        entry = kept_number(
            path,
            lambda name=name, seed=seed: network_score(
                parts, recipe, lenses[name], seed, arguments.network_steps, fresh
            ),
        )
        report["lenses"][name]["networks"].append(entry)
        print(f"seed {seed}:", line(name, report["lenses"][name]), flush=True)
    path = arguments.out_dir / "joint.json"
    path.write_text(json.dumps(report, indent=1))


def best_of(report: dict[str, Any], kind: str) -> str:
    """Give the lens of a kind that the front alone recovers best."""
    lenses = report["lenses"]
    own = [name for name in lenses if name.startswith(kind)]
    return max(own, key=lambda name: float(lenses[name]["front_db"]))


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path)
    parser.add_argument("--data", type=Path, help="pictures to design and train on")
    parser.add_argument("--fresh", type=Path, help="pictures to judge on")
    parser.add_argument("--out-dir", type=Path, default=Path("out/joint"))
    parser.add_argument("--starts", type=int, default=96)
    parser.add_argument("--spot-steps", type=int, default=80)
    parser.add_argument("--network", help="of the catalogue; without it the front alone judges")
    parser.add_argument("--network-steps", type=int, default=1000)
    parser.add_argument("--seeds", type=numbers, default=(1, 2, 3), help="of networks: 1,2,3")
    return parser.parse_args()


def numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(","))


def kept(path: Path, make: Callable[[], tuple[Tensor, dict[str, Any]]]) -> Tensor:
    """Give the lens in a file, or make it and keep it."""
    if not path.exists():
        begin = time.process_time()
        scaled, notes = make()
        notes["cpu_s"] = round(time.process_time() - begin, 1)
        path.write_text(json.dumps({"scaled": scaled.tolist(), **notes}))
        print(path.name, notes, flush=True)
    return torch.tensor(json.loads(path.read_text())["scaled"], dtype=torch.float64)


def kept_number(path: Path, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    if not path.exists():
        path.write_text(json.dumps(make()))
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def spots(
    parts: DesignParts, merit: Merit, starts: int, steps: int
) -> tuple[Tensor, dict[str, Any]]:
    """Give the best lens on spots: the start itself, starts near it, and starts anywhere."""
    problem = replace(
        parts.lens.problem, samples=half_disc(SPOT_RAYS), merit=merit, core_mm=CORE_MM[merit]
    )
    free = problem.free
    rng = np.random.default_rng(11)
    drawn = torch.from_numpy(rng.uniform(0, 1, (starts, len(free.variables))))
    near = parts.lens.begin + torch.from_numpy(rng.uniform(-0.1, 0.1, drawn.shape))
    drawn[1 : starts // 2] = near[1 : starts // 2].clamp(0, 1)
    drawn[0] = parts.lens.begin
    held = free.high <= free.low
    scouted = descend(lambda s: residuals(problem, s), drawn, 10, held)
    found = descend(
        lambda s: residuals(problem, s), scouted.scaled[: max(4, starts // 8)], steps, held
    )
    notes = {
        "merit": float(found.merits[0]),
        "evaluations": scouted.evaluations + found.evaluations,
    }
    return found.scaled[0], notes


def joint(parts: DesignParts, recipe: DesignRecipe, begin: Tensor) -> tuple[Tensor, dict[str, Any]]:
    """Give the best lens of a joint design from `begin`."""
    lens = LensModule(
        parts.lens.problem,
        parts.lens.pixels,
        begin,
        whiten=recipe.optics.whiten,
        units=recipe.optics.units,
    )
    loop = DesignLoop(replace(parts, lens=lens), recipe.schedule)
    curve = [loop.judge().valid_db] + [moment.valid_db for moment in loop.run()]
    loop.take_best()
    notes = {"evaluations": recipe.schedule.steps, "curve": curve}
    return loop.parts.lens.scaled().detach(), notes


def front_db(parts: DesignParts, recipe: DesignRecipe, scaled: Tensor, fresh: SceneSource) -> float:
    return score_design(parts, recipe.schedule, scaled, source=fresh).psnr_db


def network_score(
    parts: DesignParts,
    recipe: DesignRecipe,
    scaled: Tensor,
    seed: int,
    steps: int,
    fresh: SceneSource,
) -> dict[str, Any]:
    """Train a network of its own for a lens at rest, and judge it on fresh pictures."""
    schedule = replace(
        recipe.schedule, steps=steps, lens_rate=0.0, seed=seed, epoch_steps=max(1, steps // 12)
    )
    network = network_of(replace(recipe, schedule=schedule))
    loop = DesignLoop(replace(at_lens(parts, scaled, rays=1500), network=network), schedule)
    begin = time.process_time()
    for _ in loop.run():
        pass
    loop.take_best()
    found = score_design(parts, schedule, scaled, source=fresh, network=network)
    return {
        "psnr_db": found.psnr_db,
        "by_field_db": found.by_field_db,
        "cpu_s": round(time.process_time() - begin, 1),
    }


def line(name: str, entry: dict[str, Any]) -> str:
    networks = [n["psnr_db"] for n in entry["networks"] if n]
    seen = f"{np.mean(networks):.2f} +- {np.std(networks):.2f}" if networks else "-"
    return f"{name:28} front {entry['front_db']:.2f} dB, network {seen} dB"


if __name__ == "__main__":
    main()
