"""Checkpoints, frozen PSF and prescription -> one bundle, proved before it is written.

PSF, camera       -> golden captures                    (golden_cases)
a first bundle    -> what a network is given for them
checkpoints       -> networks -> ONNX + measured facts  (network_facts)
a second bundle   -> its outputs on the golden captures
everything        -> card, preview, manifest -> bundle -> `check_bundle`
"""

import json
import tempfile
import tomllib
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from camkit.bundle.golden import GoldenArrays, golden_to_bytes
from camkit.bundle.manifest import (
    Color,
    Demosaic,
    Illumination,
    Manifest,
    Network,
    NetworkSize,
    Threshold,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.bundle.psf_file import psf_to_bytes, read_psf
from camkit.bundle.reader import CARD, GOLDEN, PRESCRIPTION, PREVIEW, PSF, STRESS_PSF, Bundle
from camkit.bundle.writer import write_bundle
from camkit.contracts import FloatArray, FrozenPsf
from camkit.errors import ContractError, ParityError
from camkit.export.card import card_text, preview_png
from camkit.export.golden_cases import (
    GOLDEN_RECIPES,
    CaseRecipe,
    Cases,
    add_outputs,
    photograph,
)
from camkit.export.network_facts import MeasuredNetwork, measure_network
from camkit.models_def.optics.distortion import trace_distortion
from camkit.models_def.optics.lens_file.lens_file import built_in_lenses, find_lens, read_lens
from camkit.models_def.optics.prescription import Lens, format_prescription, parse_prescription
from camkit.models_def.training.checkpoint import Checkpoint, load_network, read_checkpoint
from camkit.models_def.training.recipe import Recipe, differing_camera, to_recipe
from camkit.runtime.check import check_bundle
from camkit.runtime.geometry.distortion import distort_points
from camkit.runtime.golden_run import develop_case
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.loss import read_loss_model
from camkit.units import UM_PER_MM

PACKAGES: Final = ("camkit", "numpy", "scipy", "onnx", "onnxruntime", "torch", "onnxscript")
LICENCE: Final = "CC-BY-4.0"
PROBE_RECIPE: Final = CaseRecipe(scene_seed=30, exposure=0.9, iso=400.0, field=0.6, size_px=512)
SIZES: Final[tuple[NetworkSize, ...]] = get_args(NetworkSize)
DEFAULT_SIZE: Final[NetworkSize] = "M"
SAME_LENS_PX: Final = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """What goes into a bundle.

    Attributes:
        checkpoints: One per size, of one camera.
        psf: Frozen PSF of `camkit freeze`.
        stress_psf: Kernels off the design point.
        prescription: The lens as designed; None for that of the checkpoints.
        freeze: Report of `camkit freeze` (JSON), for the manifest.
        plan: Calibration of `tools/plan_report.py` (JSON), for the manifest; measured with an
            earlier export of the same networks.
        version: Semantic version of the bundle.
    """

    checkpoints: tuple[Path, ...]
    psf: Path
    stress_psf: Path | None = None
    prescription: Path | None = None
    freeze: Path | None = None
    plan: Path | None = None
    version: str = "0.1.0"


def export_bundle(parts: Parts, out: Path) -> dict[str, Any]:
    """Pack and prove a bundle; nothing is written when a proof fails.

    Returns:
        What was written: sizes of network, bytes, and the lines of the proof.

    Raises:
        ContractError: If the checkpoints are not of one camera, a size comes twice, or the PSF
            was frozen from another lens.
        ParityError: If torch and ONNX, or the bundle and its own golden cases, disagree.
        BundleError: If the parts contradict each other.
    """
    checkpoints = _read_checkpoints(parts.checkpoints)
    recipe = _recipe(checkpoints)
    members = _members(parts, _lens_of(parts, recipe, checkpoints))
    with tempfile.TemporaryDirectory() as folder:
        bare = write_bundle(
            Path(folder) / "bare.camkit", _manifest(recipe, parts, checkpoints, {}, {}), members
        )
        cases = _golden_cases(bare)
        windows = _network_inputs(bare, cases, recipe.scale)
        networks = {
            size: measure_network(size, load_network(checkpoint), windows)
            for size, checkpoint in checkpoints.items()
        }
        for network in networks.values():
            members |= network.members
        second = write_bundle(
            Path(folder) / "second.camkit",
            _manifest(recipe, parts, checkpoints, networks, {}),
            members,
        )
        golden = add_outputs(second, cases, dict(zip(cases, windows[1:], strict=True)))
        members[GOLDEN] = golden_to_bytes(golden)
        members[CARD] = card_text(second, golden).encode()
        members[PREVIEW] = preview_png(second, golden)
        manifest = _manifest(recipe, parts, checkpoints, networks, cases)
        third = Path(folder) / "third.camkit"
        write_bundle(third, manifest, members)
        report = check_bundle(third, run=develop_case)
        if not report.passed:
            raise ParityError("the bundle fails its own check: " + "; ".join(report.lines()))
        out.parent.mkdir(parents=True, exist_ok=True)
        bundle = write_bundle(out, manifest, members)
    return {
        "bundle": str(out),
        "bytes": out.stat().st_size,
        "sha256": bundle.sha256,
        "sizes": ", ".join(networks),
        **{f"check {i}": line for i, line in enumerate(report.lines())},
    }


def _read_checkpoints(paths: tuple[Path, ...]) -> dict[NetworkSize, Checkpoint]:
    found: dict[NetworkSize, Checkpoint] = {}
    for path in paths:
        checkpoint = read_checkpoint(path)
        size = next((known for known in SIZES if known == checkpoint.size), None)
        if size is None and len(paths) == 1:
            size = DEFAULT_SIZE
        if size in found:
            raise ContractError(f"two checkpoints are of size {size}: keep one")
        if size is None:
            raise ContractError(
                f"{path} is of size {checkpoint.size}; a bundle holds the sizes S, M and L "
                "(any other network must be alone in its bundle)"
            )
        found[size] = checkpoint
    if not found:
        raise ContractError("export needs at least one checkpoint")
    recipes = {size: to_recipe(tomllib.loads(c.recipe_toml)) for size, c in found.items()}
    first = next(iter(recipes.values()))
    for size, recipe in recipes.items():
        if what := differing_camera(first, recipe):
            raise ContractError(
                f"the checkpoints are of different cameras: the recipe of {size} has another "
                f"{what}; train them for one"
            )
    return dict(sorted(found.items(), key=lambda item: SIZES.index(item[0])))


def _recipe(checkpoints: dict[NetworkSize, Checkpoint]) -> Recipe:
    return to_recipe(tomllib.loads(next(iter(checkpoints.values())).recipe_toml))


def _golden_cases(bare: Bundle) -> Cases:
    cases: Cases = {}
    for name, recipe in GOLDEN_RECIPES.items():
        case, capture, reference = photograph(name, recipe, bare)
        cases[name] = case, GoldenArrays(capture=capture, reference=reference)
    return cases


def _network_inputs(bare: Bundle, cases: Cases, scale: float) -> list[FloatArray]:
    """Give (1, 6, h, w) windows as the network sees them: a larger probe first, then the cases."""
    probe, capture, _ = photograph("probe", PROBE_RECIPE, bare)
    captures = [(probe, capture), *((case, arrays.capture) for case, arrays in cases.values())]
    pipeline = Pipeline(bare, Options(method="wiener", threads=1))
    windows = []
    for case, image in captures:
        work = pipeline.start(
            pipeline.capture_of(
                image, iso=case.iso, white_balance=case.white_balance, origin_px=case.origin_px
            )
        )
        windows.append(work.network_input(scale)[None])
    return windows


def _lens_of(
    parts: Parts, recipe: Recipe, checkpoints: dict[NetworkSize, Checkpoint]
) -> Lens | None:
    """Give the lens of the camera; None where a checkpoint from before names one by a path."""
    texts = {c.lens_toml for c in checkpoints.values() if c.lens_toml}
    if len(texts) > 1:
        raise ContractError(
            "the checkpoints were trained with different lenses; train them for one"
        )
    if parts.prescription is not None:
        return read_lens(parts.prescription)
    if texts:
        return parse_prescription(texts.pop())
    name = recipe.lens.prescription
    return find_lens(name) if name in built_in_lenses() else None


def _check_lens(lens: Lens, psf: FrozenPsf, path: Path) -> None:
    """Refuse a PSF that was frozen from another lens: no two have the same distortion."""
    own, frozen = trace_distortion(lens, psf.distortion.radius_mm), psf.distortion
    along = np.stack([np.linspace(0.0, frozen.radius_mm, 33), np.zeros(33)], axis=1)
    off_mm = np.abs(distort_points(along, own) - distort_points(along, frozen)).max()
    off_px = off_mm * UM_PER_MM / psf.pixel_pitch_um
    if off_px > SAME_LENS_PX:
        raise ContractError(
            f"{path} was not frozen from the lens {lens.name}: their distortion differs by "
            f"{off_px:.2g} px; freeze, train and export the same lens"
        )


def _members(parts: Parts, lens: Lens | None) -> dict[str, bytes]:
    psf = read_psf(parts.psf)
    members = {PSF: psf_to_bytes(psf)}
    if parts.stress_psf is not None:
        members[STRESS_PSF] = psf_to_bytes(read_psf(parts.stress_psf))
    if lens is not None:
        _check_lens(lens, psf, parts.psf)
        # written afresh: the bundle carries the user's glasses and is TOML, whatever came in
        members[PRESCRIPTION] = format_prescription(lens).encode()
    return members


def _manifest(
    recipe: Recipe,
    parts: Parts,
    checkpoints: dict[NetworkSize, Checkpoint],
    networks: dict[NetworkSize, MeasuredNetwork],
    cases: Cases,
) -> Manifest:
    distance = recipe.object_distance_mm
    return Manifest(
        name=recipe.name,
        version=parts.version,
        licence=LICENCE,
        training_data=next(iter(checkpoints.values())).training_data,
        camera=recipe.camera,
        object_distance_mm=None if np.isinf(distance) else distance,
        input_contract="raw_bayer_v1",
        border="edge",
        stages=(
            WhiteBalance(),
            Demosaic(method="fast"),
            _bank(recipe, parts),
            *((Network(scale=recipe.scale),) if networks else ()),
            Illumination(),
            Undistort(),
            Color(),
        ),
        networks={size: network.facts for size, network in networks.items()},
        golden=tuple(case for case, _ in cases.values()),
        freeze=_freeze_facts(parts),
        plan=_plan_entries(parts),
        exported_with={name: metadata.version(name) for name in PACKAGES},
    )


def _bank(recipe: Recipe, parts: Parts) -> Wiener:
    """Give the recipe's bank on the block grid that freezing chose by measured loss."""
    grid = {k: v for k, v in _freeze_facts(parts).items() if k in {"block_px", "overlap_px"}}
    return Wiener.model_validate({**recipe.wiener.model_dump(), **grid})


def _plan_entries(parts: Parts) -> dict[str, Threshold] | None:
    """Read a calibration.

    Raises:
        ContractError: If the file holds anything else.
    """
    if parts.plan is None:
        return None
    try:
        entries = json.loads(parts.plan.read_text(encoding="utf-8"))
        plan = {name: Threshold.model_validate(entry) for name, entry in entries.items()}
    except (ValueError, AttributeError) as error:
        raise ContractError(
            f"{parts.plan} is no calibration; make it with tools/plan_report.py calibrate"
        ) from error
    read_loss_model(plan)
    return plan


def _freeze_facts(parts: Parts) -> dict[str, Any]:
    if parts.freeze is None:
        return {}
    facts = json.loads(parts.freeze.read_text(encoding="utf-8"))
    return {k: v for k, v in facts.items() if isinstance(v, int | float | str)}
