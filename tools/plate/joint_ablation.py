"""What a plate becomes under a network that learns to read it, with and without the regulariser.

    python -m tools.plate.joint_ablation --out-dir out/joint --minutes 5

Every run is a joint design of `camkit plate design` with a table [reader]: cells of 24 um, streaks
of 8 to 60 pixels, three colours, a network of size S from the capture to the picture.

    bare             no plate: what the same network learns where nothing is written
    rank             a map of rank 3 from random numbers, eq. (5.12) beside the picture's loss
    rank-free        the same without eq. (5.12)
    full             every cell free, from the end of `rank` and its network, with eq. (5.12)
    full-free        the same without
    full-free-blind  the same with a network that begins anew
    full-hold        the plate stays, the network of `rank` goes on: what time alone gives

References: Sun 2021, section 5.4.1.
"""

import argparse
import json
import math
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

from camkit.models_def.design.plate.goal import Masks, masks_of
from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.design.plate.recipe import PlateRecipe, to_plate_recipe
from camkit.models_def.design.plate.run import PlateRun, PlateRunOptions
from camkit.models_def.optics.diffraction.shares import find_streaks, with_reach
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from tools.plate.collapse import HALF_PX, RADII_PX, Trial, lamp_of, scenes_of

CAMERA: Final = Path(str(resources.files("camkit.models_def.recipes"))) / "streak_thesis.toml"
RANK: Final = {"kind": "rank", "rank": 3, "offset": 1.0, "start": 0.1}
RANK_RATE: Final = 0.05
FULL_RATE: Final = 0.002
LATER: Final = 0.5
"""Of the steps, for the runs that begin where `rank` ended."""
READER: Final[dict[str, Any]] = {"size": "lean_s", "scenes": 256, "valid_patches": 48}
LOG_STEPS: Final = 25


def recipes_of(steps: int, seed: int, reader: dict[str, Any]) -> dict[str, PlateRecipe]:
    """Return the runs by name, in their order; later ones begin at the files of earlier ones."""
    later = max(1, round(LATER * steps))

    def recipe(name: str, count: int, rate: float, of_map: Any, **of_reader: Any) -> PlateRecipe:
        return to_plate_recipe(
            {
                "name": name,
                "cells": 382,
                "bench": {"diameter_mm": 9.162, "focal_length_mm": 50.0, "focus_mm": 5000.0},
                "map": of_map,
                "goal": {"far_px": 60.0},
                "pixels": {"side_px": 2 * HALF_PX + 1, "samples": 3},
                "schedule": {"steps": count, "rate": rate, "log_steps": LOG_STEPS, "seed": seed},
                "reader": {"recipe": str(CAMERA), **reader, **of_reader},
            }
        )

    flat, full = {"kind": "full", "start": 0.0}, {"kind": "full", "begin": "rank.toml"}
    rank = recipe("rank", steps, RANK_RATE, RANK)
    on = recipe("full", later, FULL_RATE, full, begin="rank.pt")
    return {
        "bare": recipe("bare", steps, FULL_RATE, flat, hold_steps=steps),
        "rank": rank,
        "rank-free": _free(rank, "rank-free"),
        "full": on,
        "full-free": _free(on, "full-free"),
        "full-free-blind": _free(recipe("", later, FULL_RATE, full), "full-free-blind"),
        "full-hold": recipe("full-hold", later, FULL_RATE, full, begin="rank.pt", hold_steps=later),
    }


def _free(recipe: PlateRecipe, name: str) -> PlateRecipe:
    goal = replace(recipe.goal, core_weight=0.0, streak_weight=0.0)
    return replace(recipe, name=name, goal=goal)


def measured(recipe: PlateRecipe, height_um: Tensor) -> dict[str, Any]:
    """Return where a plate sends the light of each colour, beside the bare lens.

    Shares sum to 1; `core_of_bare` is against the core of the bare lens, `written` what the streaks
    hold beyond its light there, `reach_px` the longest streak that is found.
    """
    pixels, bench = recipe.pixels, recipe.bench
    grid = PixelGrid(side_px=pixels.side_px, pitch_um=pixels.pitch_um, samples=pixels.samples)
    waves = torch.tensor(pixels.wavelengths_um, dtype=torch.float64)
    index = refractive_index(find_glass(recipe.glass), waves).tolist()
    masks = masks_of(recipe.goal, pixels.side_px)
    rows: dict[str, list[float]] = {}
    with torch.no_grad():
        psfs = [
            [
                plate_psf(heights, n, wave, bench=bench, grid=grid, depth_mm=bench.focus_mm)
                for n, wave in zip(index, pixels.wavelengths_um, strict=True)
            ]
            for heights in (height_um, torch.zeros_like(height_um))
        ]
    found = find_streaks(psfs[0][len(index) // 2], psfs[1][len(index) // 2])
    for psf, bare in zip(*psfs, strict=True):
        own, of_bare = _shares(psf, masks), _shares(bare, masks)
        left = own["core"] / of_bare["core"]
        reach = [streak.reach_px for streak in with_reach(found, psf, bare)]
        row = {
            **{f"{name}_share": value for name, value in own.items()},
            **{f"bare_{name}_share": value for name, value in of_bare.items()},
            "core_of_bare": left,
            "written": own["streak"] - left * of_bare["streak"],
            "reach_px": max(reach, default=0.0),
        }
        for name, value in row.items():
            rows.setdefault(name, []).append(round(value, 4))
    return rows | {"angles_deg": [round(streak.angle_deg, 1) % 180 for streak in found]}


def _shares(psf: Tensor, masks: Masks) -> dict[str, float]:
    core, streak = float((psf * masks.core).sum()), float((psf * masks.parts.sum(0)).sum())
    return {"core": core, "streak": streak, "haze": 1 - core - streak}


def run_one(recipe: PlateRecipe, out_dir: Path, minutes: float) -> dict[str, Any]:
    """Run a design, or what is left of it; tell of its begin and its end."""
    options = PlateRunOptions(
        out=out_dir / f"{recipe.name}.toml",
        recipe_folder=out_dir,
        seconds=60 * minutes,
        resume=True,
    )
    run = PlateRun(recipe, options)
    with torch.no_grad():
        first = begin_map(recipe, out_dir)().clone()
    for moment in run.go():
        picture = moment.picture
        print(f"  step {moment.step}: {moment.loss:.5f}", picture, moment.reached, flush=True)
    with torch.no_grad():
        height_um = run.loop.made().detach().clone()
    told = run.finish()
    change = height_um - first
    entries = [json.loads(line) for line in run.log.read_text("utf-8").splitlines()]
    return {
        "steps": told["steps"],
        "of_steps": told["of_steps"],
        "network_steps": told["steps"] * (recipe.reader.network_steps if recipe.reader else 0),
        "cpu_s": told["cpu_s"],
        "begin": _moment(entries[0]) | measured(recipe, first) | _linear(recipe, first),
        "end": _moment(entries[-1]) | measured(recipe, height_um) | _linear(recipe, height_um),
        "moved_um": round(float((change - change.mean()).square().mean().sqrt()), 5),
        "relief_um": round(float(height_um.std()), 5),
    }


def _moment(entry: dict[str, Any]) -> dict[str, float]:
    return {key: value for key, value in entry.items() if key.startswith("picture_")}


def _linear(recipe: PlateRecipe, height_um: Tensor) -> dict[str, float]:
    """Return what a reader without a network makes of it, in green; see `collapse`."""
    lamps = tuple(lamp_of(radius) for radius in RADII_PX)
    row = Trial(recipe=recipe, lamps=lamps, scenes=scenes_of(1, 1)).row(height_um)
    return {"linear_db": row["linear_db"], "strehl": row["strehl"]}


def main(arguments: list[str]) -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out-dir", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=math.inf, help="of each run, at most")
    parser.add_argument("--steps", type=int, default=300, help="of the plate, for a map of rank")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", nargs="+", help="some of them alone; default: all")
    chosen = parser.parse_args(arguments)
    recipes = recipes_of(chosen.steps, chosen.seed, READER)
    if unknown := sorted(set(chosen.runs or ()) - set(recipes)):
        parser.error(f"there is no run {unknown[0]!r}; there are {', '.join(recipes)}")
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    out = chosen.out_dir / "plate-joint.json"
    table = json.loads(out.read_text("utf-8")) if out.exists() else {"rows": {}}
    table |= {"steps": chosen.steps, "seed": chosen.seed}
    for name in chosen.runs or recipes:
        print(name, flush=True)
        table["rows"][name] = run_one(recipes[name], chosen.out_dir, chosen.minutes)
        out.write_text(json.dumps(table, indent=2) + "\n", encoding="utf-8")
    print(out)


if __name__ == "__main__":
    main(sys.argv[1:])
