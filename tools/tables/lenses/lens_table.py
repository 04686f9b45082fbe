"""Table 6.1, figures 6.7 and 6.8: which lens gives the best picture after recovery?

    python -m tools.tables lenses measure RECIPE --lens al2550-a aca254-050-a ours=lens.toml \
        --data PICTURES --fresh OTHERS --steps 2000 --runs out/lens-table -o RECORD.json

Every lens is set to F/4 and focused at 1 m. The recipe states the strip of the sensor (fields),
the pixels, noise, front, loss and network; its lens does not matter. The same network is trained
for each lens at rest with the same budget, for every seed, and judged on fresh pictures over the
fields; with `--depths-mm 500,700,1000,1500` one network serves all depths and each is judged.

References: Sun 2021, table 6.1.
"""

import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.design.assembly import field_azimuths, field_slopes, network_of, recorder_of
from camkit.models_def.design.design_recipe import DesignRecipe, NetworkChoice, read_design
from camkit.models_def.design.design_schedule import DesignSchedule
from camkit.models_def.design.front import Front
from camkit.models_def.design.loop import DesignLoop, DesignParts
from camkit.models_def.design.loss import DesignLoss
from camkit.models_def.optics.analysis.curves import axial_colour_mm
from camkit.models_def.optics.lens_file.lens_file import find_lens, write_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.splat import Pixels
from camkit.models_def.optics.search.variables import FreeLens
from camkit.models_def.training.losses import ssim
from camkit.models_def.training.pictures import SceneSource, open_source
from camkit.units import UM_PER_MM, to_degrees
from tools.tables.journal import Entry, digest
from tools.tables.lenses.depth_likeness import depth_mtf, likeness
from tools.tables.lenses.lens_at_rest import FieldLight, at_rest, at_work, window_of
from tools.tables.lenses.lens_page import lens_table, mean_and_spread
from tools.tables.runner import Record, Request, Table

DIGITS: Final = 5
_FIT_PATCHES: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """Settings that are the same for all lenses."""

    recipe: DesignRecipe
    depths_mm: tuple[float, ...]
    f_number: float
    object_mm: float
    focus: str
    largest_px: int
    patches: int
    data: Path | None
    fresh: Path | None
    signal_to_noise: tuple[float, ...] = ()

    def digest(self, *more: Any) -> str:
        """Return a hash of all that decides a measurement."""
        return digest(asdict(self), *more)


def measure(request: Request) -> Record:
    """Measure every lens: captured, then recovered by a network for each seed.

    Raises:
        ContractError: If two lenses have one name, or there is no network to train.
    """
    conditions, lenses = conditions_of(request.options), {}
    for name, place in lenses_by_name(request.options.lens).items():
        lens = working_lens(place, conditions)
        write_lens(lens, request.runs / f"{name}.toml")
        key = conditions.digest(asdict(lens))
        entry = request.entry(
            key, partial(_timed, partial(captured, lens, conditions)), partial(_line, name)
        )
        entry["recovered"] = [
            request.entry(
                conditions.digest(asdict(lens), seed),
                partial(_timed, partial(recovered, lens, conditions, seed)),
                partial(_line, name),
            )
            for seed in range(1, request.options.seeds + 1)
        ]
        lenses[name] = entry
        request.tell(row(name, entry))
    recipe = conditions.recipe
    slopes = torch.atan(field_slopes(recipe.optics))
    return {
        "recipe": recipe.name,
        "steps": recipe.schedule.steps,
        "network": recipe.network.name,
        "front": recipe.front.kind,
        "recovered_px": recipe.schedule.patch_px + 2 * recipe.front.margin_px,
        "f_number": conditions.f_number,
        "object_mm": conditions.object_mm,
        "focus": conditions.focus,
        "depths_mm": conditions.depths_mm,
        "field_angles_deg": [round(to_degrees(float(slope)), 3) for slope in slopes],
        "lenses": lenses,
    }


def _line(name: str, entry: Entry) -> str:
    what = f"seed {entry['seed']}" if "seed" in entry else "captured"
    return f"{name}: {what}, {entry['cpu_s']} CPU-s"


def _timed(make: Callable[[], Entry]) -> Entry:
    begin = time.process_time()
    return {**make(), "cpu_s": round(time.process_time() - begin, 1)}


class Captures(nn.Module):
    """In the place of a network: shows what the sensor recorded."""

    def forward(self, planes: Tensor) -> Tensor:
        """Return the capture (b, 3, p, p) among the planes of a front."""
        return planes[:, :3]


def lenses_by_name(lenses: list[str]) -> dict[str, str]:
    """Return built-in names or paths by the name that the table shows."""
    places: dict[str, str] = {}
    for text in lenses:
        name, _, place = text.rpartition("=")
        name = name or Path(place).stem
        if name in places:
            raise ContractError(f"two lenses are called {name}; write NAME=FILE for one of them")
        places[name] = place
    return places


def conditions_of(arguments: Namespace) -> Conditions:
    """Return what is the same for all lenses."""
    recipe = read_design(arguments.recipe)
    schedule = recipe.schedule
    steps = arguments.steps or schedule.steps
    # the rates fall over the run as they do in the recipe's
    schedule = replace(
        schedule,
        steps=steps,
        lens_rate=0.0,
        epoch_steps=max(1, round(schedule.epoch_steps * steps / schedule.steps)),
        valid_steps=max(1, steps // 10),
    )
    front = replace(recipe.front, kind=arguments.front or recipe.front.kind)
    if arguments.filter_margin_px is not None:
        front = replace(front, filter_margin_px=arguments.filter_margin_px)
    config = {**recipe.network.config, "in_channels": front.channels}
    network = replace(recipe.network, config=config)
    if arguments.network:
        network = NetworkChoice(name=arguments.network, config={"in_channels": front.channels})
    loss = recipe.loss if recipe.loss.needs_network else DesignLoss(kind="l1")
    depths = arguments.depths_mm or str(arguments.object_mm)
    return Conditions(
        recipe=replace(recipe, schedule=schedule, front=front, network=network, loss=loss),
        depths_mm=tuple(float(word) for word in depths.split(",")),
        f_number=arguments.f_number,
        object_mm=arguments.object_mm,
        focus=arguments.focus,
        largest_px=arguments.largest_kernel_px,
        patches=arguments.patches,
        data=arguments.data,
        fresh=arguments.fresh,
        signal_to_noise=tuple(arguments.signal_to_noise or ()),
    )


def working_lens(name: str, conditions: Conditions) -> Lens:
    """Return the lens as it works; foci on spots count the fields of the strip."""
    slopes = field_slopes(conditions.recipe.optics)
    lens = replace(
        find_lens(name),
        field_angles_rad=tuple(torch.atan(slopes).tolist()),
        wavelengths_um=conditions.recipe.pixels.wavelengths_um,
    )
    focus = None if conditions.focus == "own" else conditions.focus
    return at_work(
        lens,
        f_number=conditions.f_number,
        object_distance_mm=conditions.object_mm,
        focus=focus,  # type: ignore[arg-type]
    )


def parts(
    lens: Lens,
    conditions: Conditions,
    source: SceneSource,
    network: nn.Module | None,
    *,
    widest: bool,
) -> tuple[DesignParts, FieldLight]:
    """Return loop's parts: to judge in the widest window, so that patches are the same for all."""
    recipe = conditions.recipe
    weights = torch.tensor(recipe.pixels.color_weights, dtype=torch.float64)
    pixels = Pixels(
        pitch_um=recipe.pixels.pitch_um,
        kernel_px=conditions.largest_px,
        color_weights=weights / weights.sum(1, keepdim=True),
    )
    problem = Problem(
        free=FreeLens(lens=lens, variables=(), rides=False),
        slopes=field_slopes(recipe.optics),
        wavelengths_um=torch.tensor(recipe.pixels.wavelengths_um, dtype=torch.float64),
        object_distances_mm=conditions.depths_mm,
        azimuths_rad=field_azimuths(recipe.optics),
    )
    if not widest:
        pixels = replace(pixels, kernel_px=window_of(problem, pixels, conditions.largest_px))
    rest, light = at_rest(lens, problem, pixels)
    design = DesignParts(
        lens=rest,
        network=network,
        front=recipe.front,
        recorder=recorder_of(recipe),
        loss=recipe.loss,
        source=source,
    )
    return design, light


def fresh_source(plan: Conditions) -> SceneSource:
    """Open the pictures that lenses are judged on."""
    share = 0.0 if plan.fresh is None else 1.0
    return open_source(plan.fresh, picture_share=share, scenes=4, scene_px=512)


def captured(lens: Lens, conditions: Conditions) -> Entry:
    """Measure captures, and what the front alone makes of them."""
    judged, light = parts(lens, conditions, fresh_source(conditions), Captures(), widest=True)
    problem, pixels = judged.lens.problem, judged.lens.pixels
    entry = {
        "window_px": window_of(problem, pixels, conditions.largest_px),
        "axial_colour_um": (UM_PER_MM * axial_colour_mm(lens, problem.wavelengths_um)).tolist(),
        "likeness": likeness(light.kernels).tolist(),
        "mtf": depth_mtf(light.kernels, pixels.pitch_um).tolist(),
        "held": light.share_inside.tolist(),
        "arriving": light.arriving.tolist(),
        "rms_um": (1000 * light.rms_mm.nan_to_num(-1e-3)).tolist(),
        "capture": scores(judged, conditions.recipe.schedule, conditions.patches),
    }
    front = conditions.recipe.front
    if front.kind == "none":
        return entry
    if conditions.signal_to_noise:
        front = fitted_front(judged, conditions)
        entry["signal_to_noise"] = front.signal_to_noise
    alone = replace(judged, network=None, front=front)
    entry["front"] = scores(alone, conditions.recipe.schedule, conditions.patches)
    return entry


def fitted_front(judged: DesignParts, conditions: Conditions) -> Front:
    """Return the filter with the signal-to-noise ratio that is best on the training pictures."""
    source = training_source(conditions)

    def mean_db(front: Front) -> float:
        trial = replace(judged, network=None, front=front, source=source)
        return float(np.mean(scores(trial, conditions.recipe.schedule, _FIT_PATCHES)["db"]))

    front = conditions.recipe.front
    trials = (replace(front, signal_to_noise=value) for value in conditions.signal_to_noise)
    return max(trials, key=mean_db)


def training_source(conditions: Conditions) -> SceneSource:
    """Open the pictures that networks are trained on, and filters fitted."""
    data = conditions.recipe.data
    return open_source(
        conditions.data,
        picture_share=data.picture_share,
        scenes=data.procedural_scenes,
        scene_px=data.scene_px,
    )


def recovered(lens: Lens, conditions: Conditions, seed: int) -> Entry:
    """Train a network for the lens at rest, and judge it."""
    recipe = replace(conditions.recipe, schedule=replace(conditions.recipe.schedule, seed=seed))
    network = network_of(recipe)
    if network is None:
        raise ContractError("the recipe has no network: give --network")
    source = training_source(conditions)
    trained, _ = parts(lens, conditions, source, network, widest=False)
    loop = DesignLoop(trained, recipe.schedule)
    for moment in loop.run():
        if sys.stderr.isatty():
            print(
                f"{lens.name} seed {seed}: step {moment.step}, {moment.valid_db:.2f} dB",
                file=sys.stderr,
            )
    loop.take_best()
    judged, _ = parts(lens, conditions, fresh_source(conditions), network.eval(), widest=True)
    return {
        "seed": seed,
        "valid_db": loop.best_db,
        **scores(judged, conditions.recipe.schedule, conditions.patches),
    }


def scores(judged: DesignParts, schedule: DesignSchedule, patches: int) -> Entry:
    """Return `db` and `ssim` of sRGB values, (depth, field), means over the same patches."""
    loop = DesignLoop(judged, replace(schedule, valid_patches=1))
    fields = len(judged.lens.problem.slopes)
    psnr: list[list[Tensor]] = [[] for _ in range(fields)]
    alike: list[list[Tensor]] = [[] for _ in range(fields)]
    for field, pictures, sharp in loop.field_pictures(patches):
        recorded = pictures[:, 0].clamp(0, 1)
        error = (recorded - sharp).square().mean((1, 2, 3)).clamp_min(1e-10)
        psnr[field].append(-10 * torch.log10(error))
        alike[field].append(ssim(recorded, sharp.expand_as(recorded)))

    def table(patches_of: list[list[Tensor]]) -> tuple[tuple[float, ...], ...]:
        means = [torch.stack(of_field).double().mean(0) for of_field in patches_of]
        return tuple(tuple(row) for row in torch.stack(means, dim=1).tolist())

    return {"db": table(psnr), "ssim": table(alike)}


def row(name: str, entry: Entry) -> str:
    """Return the line of a lens for people."""
    if not entry["recovered"]:
        alone = f", front alone {np.mean(entry['front']['db']):.2f} dB" if "front" in entry else ""
        return f"{name:20} capture {np.mean(entry['capture']['db']):.2f} dB{alone}"
    db, spread = mean_and_spread(entry["recovered"], "db")
    alike, _ = mean_and_spread(entry["recovered"], "ssim")
    return (
        f"{name:20} capture {np.mean(entry['capture']['db']):.2f} dB, recovered {db:.2f} +- "
        f"{spread:.2f} dB, SSIM {alike:.3f}"
    )


def _options(measure: ArgumentParser) -> None:
    more: Any = measure.add_argument
    more("recipe", type=Path)
    more("--lens", nargs="+", required=True, help="names, files or NAME=FILE")
    more("--data", type=Path, help="pictures to train on")
    more("--fresh", type=Path, help="pictures to judge on")
    more("--steps", type=int, help="of every network; the recipe's by default")
    more("--seeds", type=int, default=3, help="networks of each lens; 0: the front alone")
    more("--network", help="name in the catalogue, in place of the recipe's")
    more("--front", choices=("none", "wiener"), help="in place of the recipe's")
    more(
        "--filter-margin-px",
        type=int,
        help="recorded around a patch for the filter, in place of the recipe's; half of the "
        "largest window serves every lens",
    )
    more(
        "--signal-to-noise",
        type=float,
        nargs="+",
        help="of the front that is judged alone, in place of the recipe's: of several the best "
        "for each lens on --data",
    )
    more("--depths-mm", help="such as 500,700,1000,1500")
    more("--object-mm", type=float, default=1000.0)
    more("--f-number", type=float, default=4.0)
    more(
        "--focus",
        choices=("own", "paraxial", "spot", "wavefront"),
        default="own",
        help="own: a lens made for this distance keeps its sensor, others are focused paraxially",
    )
    more("--largest-kernel-px", type=int, default=257)
    more("--patches", type=int, default=8, help="fresh patches at every field")


TABLE: Final = Table(
    description=__doc__,
    measure=measure,
    to_text=lens_table,
    add_options=_options,
    digits=DIGITS,
)
