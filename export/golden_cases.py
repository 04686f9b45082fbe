"""The golden cases of a bundle: three small captures, what it makes of them, and the truth."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import Camera, GoldenCase
from camkit.bundle.reader import Bundle
from camkit.colorimetry import apply_matrix, camera_from_rec709
from camkit.contracts import FloatArray, FrozenPsf
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.rows import ArrayRows
from camkit.runtime.simulate import Simulation, SimulationOptions, simulate
from camkit.runtime.warp import undistort_bands
from camkit.scenes import procedural_scene

CASE_PX: Final = 192
SCENE_SEED: Final = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class _Recipe:
    """How one case is photographed: exposure, ISO, and place from axis (0) to corner (1)."""

    exposure: float
    iso: float
    field: float


RECIPES: Final = {
    "typical": _Recipe(exposure=0.8, iso=100.0, field=0.45),
    "saturated": _Recipe(exposure=3.0, iso=100.0, field=0.75),
    "very_dark": _Recipe(exposure=0.02, iso=1600.0, field=0.0),
}


def photograph_cases(camera: Camera, psf: FrozenPsf) -> dict[str, tuple[GoldenCase, GoldenArrays]]:
    """Simulate the captures and their sharp references; outputs are added by `run_cases`."""
    cases = {}
    for number, (name, recipe) in enumerate(RECIPES.items()):
        origin = _origin(camera, recipe.field)
        scene = procedural_scene(SCENE_SEED + number, CASE_PX, CASE_PX)
        options = SimulationOptions(
            iso=recipe.iso, seed=number, origin_px=origin, exposure=recipe.exposure
        )
        simulation = simulate(scene, camera, psf, options)
        case = GoldenCase(
            name=name,
            recipe={
                "scene_seed": SCENE_SEED + number,
                "noise_seed": number,
                "exposure": recipe.exposure,
            },
            iso=recipe.iso,
            origin_px=origin,
            white_balance=simulation.white_balance,
        )
        reference = _reference(simulation, camera, psf)
        cases[name] = case, GoldenArrays(capture=simulation.mosaic, reference=reference)
    return cases


def run_cases(
    bundle: Bundle, cases: dict[str, tuple[GoldenCase, GoldenArrays]]
) -> dict[str, GoldenArrays]:
    """Give the cases with the pipeline's output for every size of the bundle."""
    pipelines = {
        size: Pipeline(bundle, Options(size=size, threads=1))
        for size in bundle.manifest.networks
    }
    done = {}
    for name, (case, arrays) in cases.items():
        outputs = {
            size: pipeline.process_array(
                arrays.capture,
                iso=case.iso,
                white_balance=case.white_balance,
                origin_px=case.origin_px,
            )
            for size, pipeline in pipelines.items()
        }
        done[name] = GoldenArrays(
            capture=arrays.capture, reference=arrays.reference, outputs=outputs
        )
    return done


def _origin(camera: Camera, field: float) -> tuple[int, int]:
    """Place a case on the diagonal, on a whole CFA cell."""
    spare = np.array([camera.width_px - CASE_PX, camera.height_px - CASE_PX])
    x, y = (spare * (1 + field) / 2).astype(int) // 2 * 2
    return int(x), int(y)


def _reference(simulation: Simulation, camera: Camera, psf: FrozenPsf) -> FloatArray:
    """Bring the sharp scene to the geometry and colour of the output."""
    rows = ArrayRows(simulation.clean)
    ideal = np.concatenate(
        list(undistort_bands(rows, psf.distortion, simulation.window)), axis=1
    )
    matrix, _ = camera_from_rec709(np.array(camera.color_matrix))
    return apply_matrix(np.linalg.inv(matrix), ideal)
