"""Does the ray-rendered picture agree with the PSF path that a lens was designed by?

    python -m tools.design_check RECIPE LENS [--checkpoint NAME.pt] [--data PICTURES] [-o out.json]

For some fields of every depth of the recipe a picture hangs before the lens. It is rendered by rays
from the pixels (`render`: every ray finds its own place in the picture, so distortion and the
change of the blur within a patch are in it), and by the kernels of the design loop: one kernel a
patch, about its centroid, on the picture warped by eq. (6.10). Both get the same noise and the same
recovery. Distances of the object must be finite; `--depth-mm` looks from another one and refocuses.
"""

import argparse
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.loop import DesignParts
from camkit.models_def.design.recipe import DesignRecipe, read_design
from camkit.models_def.design.starts import Starts
from camkit.models_def.optics.kernel_bank import ChannelResponse
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.render.alignment import (
    Alignment,
    align_reference,
    finer,
    fit_alignment,
    scene_radius_mm,
)
from camkit.models_def.optics.render.monte_carlo import Sampling, render
from camkit.models_def.optics.render.optics import free_optics
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.window import Window, centred_window
from camkit.models_def.optics.search.beam import LEAD
from camkit.models_def.optics.search.problem import trace_batch
from camkit.models_def.sensors.forward import blur
from camkit.models_def.sensors.tone import encode_srgb
from camkit.models_def.torch_file import load_torch
from tools.design.score import DENSE_RAYS, at_lens

LINE_UM: Final = 5e-4
SPARE: Final = 1.2
OVERSAMPLE: Final = 3
SAME_LENS: Final = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """One field of one depth: its kernels, where it lies, and what the recovery knows of it.

    Attributes:
        field: Its number.
        depth_mm: Object distance.
        kernels: (3, k, k), about the centroid.
        known: (3, k, k), what the front filters with.
        chief_mm: Height of the chief ray on the sensor.
        coma_mm: From the chief ray to the centroid.
    """

    field: int
    depth_mm: float
    kernels: Tensor
    known: Tensor
    chief_mm: float
    coma_mm: float


def main() -> None:
    """Print a row for every place, and the means."""
    arguments = parse()
    torch.set_num_threads(1)
    rows = []
    for row in check(read_design(arguments.recipe), arguments):
        rows.append(row)
        print(json.dumps(row), flush=True)
    both = {key: mean(rows, key) for key in ("agree_db", "rays_db", "map_db")}
    print(json.dumps({"mean": both}))
    if arguments.output:
        arguments.output.write_text(json.dumps({"rows": rows, "mean": both}, indent=1))


def parse(given: list[str] | None = None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path)
    parser.add_argument("lens", help="a lens within the bounds of the recipe: its name or file")
    parser.add_argument("--checkpoint", type=Path, help="of the design: its network recovers")
    parser.add_argument("--data", type=Path, help="folder of pictures; none: procedural scenes")
    parser.add_argument("--depth-mm", type=float, help="instead of the depths of the recipe")
    parser.add_argument("--fields", type=int, default=3)
    parser.add_argument("--patch-px", type=int, default=64)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--passes", type=int, default=4, help="in each of two halves")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path)
    return parser.parse_args(given)


def check(recipe: DesignRecipe, arguments: argparse.Namespace) -> Iterator[dict[str, float]]:
    """Return a row of numbers for every field and depth.

    Raises:
        ContractError: If the object is at infinity or the lens outside the bounds of the recipe.
    """
    parts = dense_parts(recipe, arguments)
    rng = np.random.default_rng(arguments.seed)
    for spot in spots(parts, arguments):
        yield judged(parts, spot, arguments, rng)


def dense_parts(recipe: DesignRecipe, arguments: argparse.Namespace) -> DesignParts:
    """Return the parts of a design with the lens in place, many rays and the trained network."""
    if arguments.depth_mm:
        optics = replace(
            recipe.optics, object_distances_mm=(arguments.depth_mm,), focus_distance_mm=0.0
        )
        recipe = replace(recipe, optics=optics)
    recipe = replace(recipe, prescription=arguments.lens, starts=Starts())
    parts = parts_of(recipe, pictures=arguments.data)
    begin, problem = parts.lens.begin, parts.lens.problem
    if not all(map(np.isfinite, problem.depths_mm)):
        raise ContractError("rays need a picture at a finite distance; give --depth-mm")
    given, same = problem.free.lens, problem.free.made(begin)
    for one, other in zip(same.surfaces, given.surfaces, strict=True):
        curvature = (one.curvature_per_mm - other.curvature_per_mm) * 50
        if max(abs(one.conic - other.conic), abs(curvature)) > SAME_LENS:
            raise ContractError(f"{given.name} lies outside the bounds of recipe {recipe.name}")
    if arguments.checkpoint is None:
        parts = replace(parts, network=None)
    elif parts.network is not None:
        table = load_torch(arguments.checkpoint, "checkpoint of camkit")
        parts.network.load_state_dict(table["best"]["network"])
    return at_lens(parts, begin, rays=DENSE_RAYS)


def spots(parts: DesignParts, arguments: argparse.Namespace) -> list[Spot]:
    """Return some fields of all depths, evenly over those about which the lens passes a patch."""
    problem = parts.lens.problem
    with torch.no_grad():
        kernels = parts.lens()[0].float()
    every = spots_at(parts, kernels, range(len(problem.slopes)))
    passed = [s for s in every if passes(parts, s, arguments)]
    heights = sorted({s.field for s in passed})
    if not heights:
        raise ContractError("the lens passes no whole patch at any field; give fewer --patch-px")
    chosen = np.linspace(0, len(heights) - 1, arguments.fields).round().astype(int)
    wanted = {heights[i] for i in chosen.tolist()}
    return [s for s in passed if s.field in wanted]


def passes(parts: DesignParts, spot: Spot, arguments: argparse.Namespace) -> bool:
    """Return whether rays reach all that the kernels of a patch reach: one sample a pixel says."""
    window = window_of(parts, spot, arguments)
    one = argparse.Namespace(**{**vars(arguments), "spp": 1, "passes": 1})
    try:
        texture = hung(parts, aligned(parts, spot, window), window, np.random.default_rng(0))
        by_rays(parts, spot, texture, window, one)
    except ContractError:
        return False
    return True


def spots_at(parts: DesignParts, kernels: Tensor, fields: Iterable[int]) -> list[Spot]:
    """Return fields of all depths, with kernels (depth, field, 3, k, k)."""
    problem = parts.lens.problem
    found = []
    for depth, depth_mm in enumerate(problem.depths_mm):
        with torch.no_grad():
            landed = trace_batch(problem, parts.lens.begin[None], depth_mm).landed
        reference = landed.y.shape[2] // 2
        for field in fields:
            alive = landed.valid[0, field, :, LEAD:]
            centroid = float(landed.y[0, field, :, LEAD:][alive].mean())
            chief = float(landed.y[0, field, reference, 0])
            own = kernels[depth, field]
            known = own if parts.front.depth_known else kernels[:, field].mean(0)
            found.append(
                Spot(
                    field=field,
                    depth_mm=depth_mm,
                    kernels=own,
                    known=known,
                    chief_mm=chief,
                    coma_mm=centroid - chief,
                )
            )
    return found


def judged(
    parts: DesignParts, spot: Spot, arguments: argparse.Namespace, rng: np.random.Generator
) -> dict[str, float]:
    """Render one patch both ways and recover both."""
    window = window_of(parts, spot, arguments)
    side = window.height_px
    alignment = aligned(parts, spot, window)
    texture = hung(parts, alignment, window, rng)
    halves = by_rays(parts, spot, texture, window, arguments)
    rays = (halves[0] + halves[1]) / 2
    mapped, sharp = by_kernels(parts, spot, texture, window, alignment)
    noise = parts.recorder.noise * torch.from_numpy(
        rng.standard_normal((3, side, side), dtype=np.float32)
    )
    return {
        "depth_mm": spot.depth_mm,
        "height_mm": round(spot.chief_mm, 3),
        "agree_db": psnr_db(rays, mapped),
        # of the mean of both halves: its noise is half their difference
        "ray_noise_db": psnr_db(*halves) + 20 * float(np.log10(2)),
        "rays_db": recovered_db(parts, rays + noise, spot.known, sharp),
        "map_db": recovered_db(parts, mapped + noise, spot.known, sharp),
    }


def window_of(parts: DesignParts, spot: Spot, arguments: argparse.Namespace) -> Window:
    """Return a patch and what its front needs around it."""
    side = arguments.patch_px + 2 * parts.front.margin_px
    window = centred_window(side, side, parts.lens.pixels.pitch_um)
    return replace(window, top_mm=window.top_mm + spot.chief_mm)


def aligned(parts: DesignParts, spot: Spot, window: Window) -> Alignment:
    """Fit eq. (6.10) over a patch and all that its kernels reach."""
    lens = parts.lens.problem.free.made(parts.lens.begin)
    around = finer(window, 1, parts.lens.pixels.kernel_px)
    return fit_alignment(with_object_distance(lens, spot.depth_mm), around)


def hung(
    parts: DesignParts, alignment: Alignment, window: Window, rng: np.random.Generator
) -> Texture:
    """Hang a picture so that its middle lands on that of the window, a sample to a pixel."""
    side = round(SPARE * (window.height_px + parts.lens.pixels.kernel_px))
    middle_mm = max(0.0, window.top_mm + (window.height_px - 1) / 2 * window.pitch_mm)
    heights = np.array([middle_mm, middle_mm + window.pitch_mm])
    near_mm, far_mm = map(float, scene_radius_mm(alignment, heights))
    pitch_mm, middle = far_mm - near_mm, (side - 1) / 2
    return Texture(
        values=torch.from_numpy(parts.source.draw_crop(rng, side).clip(0, 1)),
        pitch_mm=pitch_mm,
        axis_px=(middle - near_mm / pitch_mm, middle),
    )


def by_rays(
    parts: DesignParts,
    spot: Spot,
    texture: Texture,
    window: Window,
    arguments: argparse.Namespace,
) -> tuple[Tensor, Tensor]:
    """Render (3, s, s) twice, with rays of their own."""
    optics = free_optics(parts.lens.problem.free, parts.lens.begin, spot.depth_mm)

    def half(number: int) -> Tensor:
        seed = 2 * arguments.seed + number
        sampling = Sampling(spp=arguments.spp, passes=arguments.passes, seed=seed)
        return render(texture, optics, lines(parts), window, sampling)

    return half(0), half(1)


def by_kernels(
    parts: DesignParts, spot: Spot, texture: Texture, window: Window, alignment: Alignment
) -> tuple[Tensor, Tensor]:
    """Return the capture (3, s, s) without noise, and what a lens without blur would record."""
    edge = parts.lens.pixels.kernel_px // 2
    # a pixel with the centroid of a spot sees what the chief ray of another one sees
    around = finer(window, 1, edge)
    around = replace(around, top_mm=around.top_mm - spot.coma_mm)
    sharp = align_reference(texture, alignment, around, oversample=OVERSAMPLE).float()
    light = blur(sharp[None], spot.kernels[None])[0]
    return light, sharp[:, edge : edge + window.height_px, edge : edge + window.width_px]


def lines(parts: DesignParts) -> ChannelResponse:
    """Return the colours of the design as narrow lines: rays draw wavelengths from a continuum."""
    waves = parts.lens.problem.wavelengths_um.numpy()
    weights = parts.lens.pixels.color_weights.numpy()
    grid = (waves[:, None] + LINE_UM * np.array([-1.0, 0.0, 1.0])).flatten()
    response = (weights[:, :, None] * np.array([0.0, 1.0, 0.0])).reshape(3, -1)
    return ChannelResponse(wavelengths_um=grid, response=response, source="lines of the design")


def recovered_db(parts: DesignParts, recorded: Tensor, known: Tensor, sharp: Tensor) -> float:
    """Recover a capture (3, s, s) and compare it with the sharp picture, in sRGB tone."""
    with torch.no_grad():
        planes = parts.front.planes(recorded.clamp(0, 1)[None], known[None])
        found = planes[:, -3:] if parts.network is None else parts.network(planes)
    edge = parts.front.margin_px
    inner = slice(edge, sharp.shape[-1] - edge)
    gap = found[0].clamp(0, 1) - encode_srgb(sharp[:, inner, inner])
    return -10 * float(torch.log10(gap.square().mean()))


def psnr_db(one: Tensor, other: Tensor) -> float:
    """Return the PSNR of two linear pictures in sRGB tone."""
    gap = encode_srgb(one.clamp(0, 1)) - encode_srgb(other.clamp(0, 1))
    return -10 * float(torch.log10(gap.square().mean().clamp_min(1e-12)))


def mean(rows: list[dict[str, float]], key: str) -> float:
    """Return the mean of a column."""
    return sum(row[key] for row in rows) / len(rows)


if __name__ == "__main__":
    main()
