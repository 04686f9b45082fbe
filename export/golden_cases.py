"""Small captures of known scenes: the golden cases of a bundle, and probes for measurements."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import Camera, GoldenCase
from camkit.bundle.reader import Bundle
from camkit.colorimetry import apply_matrix, rec709_from_camera
from camkit.contracts import FloatArray, FrozenPsf
from camkit.errors import ContractError
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.golden_run import develop_case
from camkit.runtime.rows import ArrayRows
from camkit.runtime.simulate import Simulation, SimulationOptions, simulate
from camkit.scenes import procedural_scene

SIDE_STEP_PX: Final = 64
"""Every network takes sides that are multiples of it."""

Cases = dict[str, tuple[GoldenCase, GoldenArrays]]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRecipe:
    """How one case is photographed.

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
) -> tuple[GoldenCase, np.ndarray, FloatArray]:
    """Simulate one case with the camera of a bundle, at its reference depth.

    Returns:
        The case, its capture (h, w) uint16, and the sharp scene (3, h, w) float32 in the
        geometry and colour of the output.
    """
    camera, psf = bundle.manifest.camera, bundle.psf
    side_px = _side_px(camera, recipe)
    origin = _origin(camera, recipe.field, side_px)
    scene = procedural_scene(recipe.scene_seed, side_px, side_px)
    options = SimulationOptions(
        iso=recipe.iso,
        seed=recipe.scene_seed,
        origin_px=origin,
        exposure=recipe.exposure,
        depth_mm=bundle.reference_depth_mm,
    )
    simulation = simulate(scene, camera, psf, options)
    case = GoldenCase(
        name=name,
        recipe={
            "scene_seed": recipe.scene_seed,
            "noise_seed": recipe.scene_seed,
            "exposure": recipe.exposure,
        },
        iso=recipe.iso,
        origin_px=origin,
        white_balance=simulation.white_balance,
    )
    return case, simulation.mosaic, _reference(simulation, camera, psf)


def add_outputs(
    bundle: Bundle, cases: Cases, windows: Mapping[str, FloatArray]
) -> dict[str, GoldenArrays]:
    """Give the cases with the pipeline's output for every size, and what the network was given.

    Args:
        bundle: The bundle with its networks.
        cases: Captures and references.
        windows: (1, 6, h, w) network input per case.
    """
    return {
        name: GoldenArrays(
            capture=arrays.capture,
            reference=arrays.reference,
            outputs={
                size: develop_case(bundle, case, arrays, size) for size in bundle.manifest.networks
            },
            network_input=windows[name][0],
        )
        for name, (case, arrays) in cases.items()
    }


def _side_px(camera: Camera, recipe: CaseRecipe) -> int:
    """Give the side of a case: a small sensor makes it smaller."""
    least = min(camera.width_px, camera.height_px)
    side_px = min(recipe.size_px, least // SIDE_STEP_PX * SIDE_STEP_PX)
    if side_px == 0:
        raise ContractError(
            f"a sensor needs at least {SIDE_STEP_PX} x {SIDE_STEP_PX} px; got "
            f"{camera.width_px} x {camera.height_px}"
        )
    return side_px


def _origin(camera: Camera, field: float, side_px: int) -> tuple[int, int]:
    """Place a case on the diagonal, on a whole CFA cell."""
    spare = np.array([camera.width_px, camera.height_px]) - side_px
    x, y = (spare * (1 + field) / 2).astype(int) // 2 * 2
    return int(x), int(y)


def _reference(simulation: Simulation, camera: Camera, psf: FrozenPsf) -> FloatArray:
    rows = ArrayRows(simulation.clean)
    ideal = np.concatenate(list(undistort_bands(rows, psf.distortion, simulation.window)), axis=1)
    return apply_matrix(rec709_from_camera(np.array(camera.color_matrix)), ideal)
