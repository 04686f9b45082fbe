"""Small captures of known scenes: the golden cases of a bundle, and probes for measurements."""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.golden import NO_SIZE, GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import MOSAIC, Extent
from camkit.errors import ContractError
from camkit.progress import working
from camkit.runtime.kind import part_of
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.twin.light import stated_balance
from camkit.runtime.twin.simulate import SimulationOptions
from camkit.runtime.twin.truth import ideal_picture, picture_scale
from camkit.scenes import procedural_scene

SIDE_STEP_PX: Final = 64
"""Every network takes sides that are multiples of it."""

HAZE_SCENE: Final = "procedural:23"
"""Taken for a capture of the whole sensor in cells."""

Cases = dict[str, tuple[GoldenCase, GoldenArrays]]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRecipe:
    """The settings of one case.

    Attributes:
        scene_seed: Seed of the procedural scene; the noise takes the same.
        exposure: Factor on the scene.
        iso: ISO speed.
        field: Place on the diagonal, 0 at the axis, 1 in the corner.
        size_px: Side of the square capture, where the sensor is as large; a multiple of
            `SIDE_STEP_PX`.
    """

    scene_seed: int
    exposure: float
    iso: float
    field: float
    size_px: int = 192


GOLDEN_RECIPES: Final = {
    "typical": CaseRecipe(scene_seed=20, exposure=0.8, iso=100.0, field=0.45),
    "saturated": CaseRecipe(scene_seed=21, exposure=3.0, iso=100.0, field=0.75),
    "very_dark": CaseRecipe(scene_seed=22, exposure=0.02, iso=1600.0, field=0.0),
}


def photograph(
    name: str, recipe: CaseRecipe, bundle: Bundle
) -> tuple[GoldenCase, NDArray[Any], FloatArray]:
    """Simulate one case with the camera of a bundle, at its reference depth.

    Returns:
        The case, its capture as the sensor gives it, and the sharp scene (3, h, w) float32 in the
        geometry and colour of the product `image`.
    """
    manifest = bundle.manifest
    scale, extent = picture_scale(manifest), manifest.sensor.known_extent
    side_px = _side_px(extent, recipe)
    step_px = 2 if manifest.sensor.captured == MOSAIC else 1
    origin = _origin(extent, recipe.field, side_px, step_px)
    scene = procedural_scene(recipe.scene_seed, scale * side_px, scale * side_px)
    options = SimulationOptions(
        iso=recipe.iso,
        seed=recipe.scene_seed,
        origin_px=origin,
        exposure=recipe.exposure,
        scale=scale,
        depth_mm=bundle.reference_depth_mm if manifest.optics else None,
    )
    simulation = part_of(manifest).simulate(scene, bundle, options)
    case = GoldenCase(
        name=name,
        recipe={
            "scene_seed": recipe.scene_seed,
            "noise_seed": recipe.scene_seed,
            "exposure": recipe.exposure,
        },
        iso=recipe.iso,
        origin_px=origin,
        white_balance=stated_balance(simulation.white_balance),
    )
    return case, simulation.samples, ideal_picture(simulation, bundle)


@working("photographing golden cases")
def photograph_all(bundle: Bundle) -> Cases:
    """Photograph all golden cases, their outputs still to be added."""
    golden = part_of(bundle.manifest).golden
    if golden is not None:
        return dict(golden.cases(bundle))
    cases: Cases = {}
    for name, recipe in GOLDEN_RECIPES.items():
        case, capture, reference = photograph(name, recipe, bundle)
        cases[name] = case, GoldenArrays(capture=capture, reference=reference)
    return cases


@working("computing golden cases")
def add_outputs(bundle: Bundle, cases: Cases) -> dict[str, GoldenArrays]:
    """Return the cases with the outputs of the pipeline, for every product and size."""
    return {
        name: replace(arrays, outputs=_outputs(bundle, case, arrays))
        for name, (case, arrays) in cases.items()
    }


def _outputs(
    bundle: Bundle, case: GoldenCase, arrays: GoldenArrays
) -> dict[str, dict[str, FloatArray]]:
    outputs: dict[str, dict[str, FloatArray]] = {}
    for size in bundle.manifest.sizes or (None,):
        work = case_work(bundle, case, arrays, size)
        for product in work.products:
            outputs.setdefault(product, {})[size or NO_SIZE] = work.fill(product=product)
    return outputs


def _side_px(extent: Extent, recipe: CaseRecipe) -> int:
    """Return the side of a case: a small sensor makes it smaller."""
    least = min(extent.width_px, extent.height_px)
    side_px = min(recipe.size_px, least // SIDE_STEP_PX * SIDE_STEP_PX)
    if side_px == 0:
        raise ContractError(
            f"a sensor needs at least {SIDE_STEP_PX} x {SIDE_STEP_PX} px; got "
            f"{extent.width_px} x {extent.height_px}"
        )
    return side_px


def _origin(extent: Extent, field: float, side_px: int, step_px: int) -> tuple[int, int]:
    """Place a case on the diagonal, on a whole CFA cell."""
    spare = np.array([extent.width_px, extent.height_px]) - side_px
    x, y = (spare * (1 + field) / 2).astype(int) // step_px * step_px
    return int(x), int(y)
