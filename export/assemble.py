"""Checkpoints, frozen PSF, lens or plate -> one bundle, proved before it is written.

a lens, a plate   -> held against the PSF                           (designed_optics)
checkpoints       -> networks -> ONNX, with what their graphs say   (network_facts)
a first bundle    -> golden captures, and what its networks are given for them
networks, inputs  -> measured facts                                 (network_facts)
a second bundle   -> its outputs on the golden captures             (golden_cases)
a third bundle    -> the laws of its pictures
everything        -> card, preview, manifest -> bundle -> `check_bundle`

What a camera is made of, its kind says (`camkit.models_def.training.kind.Design`).
"""

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.chain import rewired
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.frozen_optics import FrozenOptics, read_optics_file
from camkit.bundle.golden import IMAGE, GoldenArrays
from camkit.bundle.haze_file import haze_to_bytes, read_haze
from camkit.bundle.manifest import (
    LIGHT_VERSION,
    Manifest,
    Threshold,
    format_of,
    planes_of,
)
from camkit.bundle.optics import PSF
from camkit.bundle.psf_file import psf_from_bytes, psf_to_bytes, read_psf
from camkit.bundle.reader import (
    CARD,
    PREVIEW,
    STRESS_HAZE,
    STRESS_PSF,
    Bundle,
)
from camkit.bundle.stages import Dehaze, Network, Stage, Wiener
from camkit.bundle.stages import Parts as KnownParts
from camkit.bundle.writer import write_bundle
from camkit.calibration.psf_import.kernel_places import reach_note
from camkit.calibration.psf_import.kernel_resampling import for_sensor
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.export.card import card_text, laws_text, preview_png
from camkit.export.designed_optics import check_measured, designed_members, designed_of
from camkit.export.golden_cases import (
    CaseRecipe,
    Cases,
    add_outputs,
    photograph,
    photograph_all,
)
from camkit.export.network_facts import ExportedNetwork, draft_network, measure_network
from camkit.export.parts import PSF_NAME, Parts
from camkit.export.proving import golden_members, write_proved
from camkit.models_def.training.checkpoint import (
    Checkpoint,
    load_network,
    read_checkpoint,
    recipe_of,
)
from camkit.models_def.training.credits import joined_credits
from camkit.models_def.training.kind import (
    Design,
    TrainingKind,
    read_recipe,
    special_part,
    training_kind,
)
from camkit.models_def.training.recipe import Recipe, differing_part
from camkit.runtime.kind import part_of
from camkit.runtime.plan.loss import read_loss_model
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.proof.laws.proof import measure_laws, with_laws
from camkit.side_file import read_side_text
from camkit.units import to_mm

PACKAGES: Final = ("camkit", "numpy", "scipy", "onnx", "onnxruntime", "torch", "onnxscript")
LICENCE: Final = "CC-BY-4.0"
WHITE: Final = "white"
"""In the recipe of a case whose pictures have another white than 1."""
PROBE: Final = "probe"
PROBE_RECIPE: Final = CaseRecipe(scene_seed=30, exposure=0.9, iso=400.0, field=0.6, size_px=512)
SIZES: Final = ("S", "M", "L")
DEFAULT_SIZE: Final = "M"

Checkpoints = dict[str, dict[str, Checkpoint]]
"""Role -> size -> checkpoint."""
Networks = dict[str, dict[str, ExportedNetwork]]


def export_bundle(parts: Parts, out: Path) -> dict[str, Any]:
    """Pack and prove a bundle; nothing is written when a proof fails.

    Returns:
        What was written: sizes of network, bytes, and the lines of the proof.

    Raises:
        ContractError: If the checkpoints are not of one camera, one size of a role comes twice or
            not at all, or the PSF was frozen from another lens.
        ParityError: If torch and ONNX, or the bundle and its own golden cases, disagree.
        BundleError: If the parts contradict each other.
    """
    camera = _camera(parts)
    members = _members(parts, camera)
    with tempfile.TemporaryDirectory() as folder:
        torch_networks = {
            (role, size): load_network(checkpoint)
            for role, sizes in camera.checkpoints.items()
            for size, checkpoint in sizes.items()
        }
        drafts = _each(
            camera.checkpoints,
            lambda role, size: draft_network(
                f"{role}_{size}",
                torch_networks[role, size],
                camera.kind.layout(camera.recipe, role),
            ),
        )
        manifest = _manifest(camera, parts, drafts)
        first = write_bundle(Path(folder) / "first.camkit", manifest, members | _models(drafts))
        cases = photograph_all(first)
        windows = _windows(first, cases)
        networks = _each(
            camera.checkpoints,
            lambda role, size: measure_network(
                drafts[role][size], torch_networks[role, size], windows[role, size]
            ),
        )
        members |= _models(networks)
        manifest = _manifest(camera, parts, networks)
        second = write_bundle(Path(folder) / "second.camkit", manifest, members)
        golden = add_outputs(second, cases)
        members |= golden_members(second, golden)
        whites = {name: float(case.recipe.get(WHITE, 1.0)) for name, (case, _) in cases.items()}
        manifest = manifest.model_copy(update={"golden": tuple(case for case, _ in cases.values())})
        third = write_bundle(Path(folder) / "third.camkit", manifest, members)
        laws = measure_laws(third)
        manifest = with_laws(manifest, laws)
        card = card_text(second, golden, camera.design.fails_on, whites)
        members[CARD] = (card + laws_text(laws)).encode()
        members[PREVIEW] = preview_png(second, golden)
        out.parent.mkdir(parents=True, exist_ok=True)
        bundle, report = write_proved(out, manifest, members)
    return {
        "bundle": str(out),
        "bytes": out.stat().st_size,
        "sha256": bundle.sha256,
        "sizes": ", ".join(bundle.manifest.sizes) or "none",
        **_notes(camera),
        **{f"check {i}": line for i, line in enumerate(report.lines())},
    }


def _notes(camera: "_Camera") -> dict[str, str]:
    """Return what is odd of the networks, and of the places of a measured PSF."""
    untrained = [
        f"the network {size}{'' if len(camera.checkpoints) == 1 else f' of {role}'} was not "
        "trained: step 0"
        for role, sizes in camera.checkpoints.items()
        for size, checkpoint in sizes.items()
        if checkpoint.step == 0
    ]
    notes = {"warning": "; ".join(untrained)} if untrained else {}
    extent = camera.recipe.sensor.extent
    if PSF not in camera.designed or extent is None:
        return notes
    pitch_um = extent.pixel_pitch_um
    sides_mm = (to_mm(side * pitch_um) for side in (extent.width_px, extent.height_px))
    note = reach_note(camera.optics.psf, *sides_mm)
    return notes if note is None else notes | {"note": note}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Camera:
    """The exported camera, with every size of every role, and its optics as designed."""

    kind: TrainingKind[Any, Any]
    recipe: Recipe
    design: Design
    checkpoints: Checkpoints
    designed: Mapping[str, bytes]
    optics: FrozenOptics
    freeze: Mapping[str, Any]
    plan: dict[str, Threshold] | None


def _camera(parts: Parts) -> _Camera:
    if parts.recipe is None:
        recipe, by_role, designed = _trained(parts)
    else:
        recipe, by_role = read_recipe(parts.recipe), {}
        find_designed = special_part(recipe.kind, "DESIGNED")
        designed = {} if find_designed is None else find_designed(recipe, parts.recipe.parent)
    kind = training_kind(recipe.kind)
    design = kind.design(recipe)
    if not by_role:
        design = replace(design, stages=_without_networks(design.stages, recipe.kind))
    return _Camera(
        kind=kind,
        recipe=recipe,
        design=design,
        checkpoints=by_role,
        designed=designed,
        optics=_optics(parts, recipe, design, designed),
        freeze=_freeze_facts(parts),
        plan=_plan_entries(parts),
    )


def _trained(parts: Parts) -> tuple[Recipe, Checkpoints, Mapping[str, bytes]]:
    """Return recipe, networks and optics of checkpoints, which must be of one camera."""
    if not parts.checkpoints:
        raise ContractError("export needs at least one checkpoint")
    checkpoints = [read_checkpoint(path) for path in parts.checkpoints]
    recipe = recipe_of(checkpoints[0])
    kind = training_kind(recipe.kind)
    for path, checkpoint in zip(parts.checkpoints[1:], checkpoints[1:], strict=True):
        what = differing_part(recipe, recipe_of(checkpoint), ("kind", *kind.camera_parts))
        if what:
            raise ContractError(
                f"the checkpoints are of different cameras: the recipe of {path} has another "
                f"{what} than that of {parts.checkpoints[0]}; train them for one"
            )
    by_role = _by_role(kind.roles, parts.checkpoints, checkpoints)
    return recipe, by_role, designed_of(checkpoints)


def _without_networks(stages: tuple[Stage, ...], kind: str) -> tuple[Stage, ...]:
    """Return the stages that restore without a network.

    Raises:
        ContractError: If none of them does.
    """
    if not any(isinstance(stage, Wiener) for stage in stages):
        raise ContractError(
            f"a camera of the kind {kind} has no filter that restores without its network; train "
            "one"
        )
    return rewired([stage for stage in stages if not isinstance(stage, Network)], stages)


def _optics(
    parts: Parts, recipe: Recipe, design: Design, designed: Mapping[str, bytes]
) -> FrozenOptics:
    """Read the optics, with their haze where a stage removes one.

    Raises:
        ContractError: If there are none, or a haze and no such stage, or the other way round.
    """
    channels = len(recipe.sensor.channels)
    if parts.psf is not None:
        optics = read_optics_file(parts.psf, channels=channels)
        if PSF in designed:  # the file may be the one that was imported
            psf = for_sensor(optics.psf, recipe.sensor.known_extent.pixel_pitch_um, channels)
            measured = psf_from_bytes(designed[PSF], what="the measured PSF")
            check_measured(measured, psf, parts.psf)
            optics = replace(optics, psf=psf)
    elif PSF in designed:
        optics = FrozenOptics(psf=psf_from_bytes(designed[PSF], what="the measured PSF"))
    else:
        folder = (parts.recipe or parts.checkpoints[0]).parent
        raise ContractError(
            f"there is no {folder / PSF_NAME}; make it with `camkit freeze`, or add "
            f"{option_text('psf')}"
        )
    undone = any(isinstance(stage, Dehaze) for stage in design.stages)
    if undone == (parts.haze is None):
        raise ContractError(
            f"the recipe {recipe.name} removes veiling glare: make it with "
            f"`camkit freeze --haze`, add {option_text('haze')}"
            if undone
            else f"the recipe {recipe.name} undoes no haze, but there is {parts.haze}: freeze the "
            "PSF without it, or keep the two in a folder of their own"
        )
    return optics if parts.haze is None else replace(optics, haze=read_haze(parts.haze))


def _by_role(
    roles: tuple[str, ...], paths: tuple[Path, ...], checkpoints: list[Checkpoint]
) -> Checkpoints:
    """Sort checkpoints by role and size: every role in the same sizes."""
    by_role: Checkpoints = {role: {} for role in roles}
    for path, checkpoint in zip(paths, checkpoints, strict=True):
        role, size = checkpoint.role, checkpoint.size
        if role not in by_role:
            have = ", ".join(roles)
            raise ContractError(f"{path} is of the role {role!r}; this kind of camera has {have}")
        alone = [c.role for c in checkpoints].count(role) == 1
        if size not in SIZES and not alone:
            raise ContractError(
                f"{path} is of size {size}; a bundle holds the sizes S, M and L "
                "(any other network must be alone in its role)"
            )
        size = size if size in SIZES else DEFAULT_SIZE
        if size in by_role[role]:
            raise ContractError(f"two checkpoints of the role {role} are of size {size}: keep one")
        by_role[role][size] = checkpoint
    all_sizes = {size for sizes in by_role.values() for size in sizes}
    for role, sizes in by_role.items():
        if missing := sorted(all_sizes - sizes.keys(), key=SIZES.index):
            raise ContractError(f"there is no checkpoint of the role {role}, size {missing[0]}")
    return {
        role: dict(sorted(s.items(), key=lambda i: SIZES.index(i[0])))
        for role, s in by_role.items()
    }


def _each(checkpoints: Checkpoints, make: Callable[[str, str], ExportedNetwork]) -> Networks:
    return {role: {size: make(role, size) for size in sizes} for role, sizes in checkpoints.items()}


def _models(networks: Networks) -> dict[str, bytes]:
    members: dict[str, bytes] = {}
    for sizes in networks.values():
        for network in sizes.values():
            members |= network.members
    return members


def _windows(bundle: Bundle, cases: Cases) -> dict[tuple[str, str], list[FloatArray]]:
    """Return the inputs of every network: for a larger probe first, then for the golden cases."""
    captures, golden = list(cases.values()), part_of(bundle.manifest).golden
    windows: dict[tuple[str, str], list[FloatArray]] = {}
    if golden is None:
        case, capture, reference = photograph(PROBE, PROBE_RECIPE, bundle)
        captures.insert(0, (case, GoldenArrays(capture=capture, reference=reference)))
    else:
        for role, sizes in bundle.manifest.networks.items():
            windows |= {(role, size): [golden.probe(bundle, role)[None]] for size in sizes}
    for size in bundle.manifest.sizes:
        for one, arrays in captures:
            work = case_work(bundle, one, arrays, size)
            for role in bundle.manifest.networks:
                window = np.ascontiguousarray(work.network_input(role))[None]
                windows.setdefault((role, size), []).append(window)
    return windows


def _members(parts: Parts, camera: _Camera) -> dict[str, bytes]:
    members = camera.optics.members | _stress_members(parts, camera.optics)
    return members | designed_members(parts, camera.designed, camera.optics)


def _stress_members(parts: Parts, optics: FrozenOptics) -> dict[str, bytes]:
    """Return kernels off the design point, with their haze where there is one.

    Raises:
        ContractError: If a haze is given without its kernels, of other samples, or for optics that
            have none.
    """
    if parts.stress_haze is None:
        path = parts.stress_psf
        return {} if path is None else {STRESS_PSF: psf_to_bytes(read_psf(path))}
    if parts.stress_psf is None or optics.haze is None:
        raise ContractError(
            f"{parts.stress_haze} is the haze of kernels off the design point, for optics with a "
            f"haze; add {option_text('stress_psf')} too, or keep it in a folder of its own"
        )
    stress = FrozenOptics(psf=read_psf(parts.stress_psf), haze=read_haze(parts.stress_haze))
    assert stress.haze is not None
    return {STRESS_PSF: psf_to_bytes(stress.psf), STRESS_HAZE: haze_to_bytes(stress.haze)}


def _manifest(camera: _Camera, parts: Parts, networks: Networks) -> Manifest:
    recipe, design = camera.recipe, camera.design
    optics = camera.optics.entry(design.object_distance_mm)
    facts: dict[str, dict[str, NetworkFacts]] = {
        role: {size: network.facts for size, network in sizes.items()}
        for role, sizes in networks.items()
    }
    stages = tuple(_on_frozen_grid(stage, camera.freeze) for stage in design.stages)
    stage_parts = KnownParts(sensor=recipe.sensor, optics=optics, networks=facts)
    data = (c.training_data for sizes in camera.checkpoints.values() for c in sizes.values())
    return Manifest(
        format_version=format_of(camera.optics.psf, (optics, *stages), least=LIGHT_VERSION),  # laws
        kind=recipe.kind,
        name=recipe.name,
        version=parts.version,
        licence=LICENCE,
        training_data=joined_credits(data),
        sensor=recipe.sensor,
        optics=optics,
        stages=stages,
        planes=planes_of(stages, stage_parts),
        products={IMAGE: stages[-1].gives[0], **design.products},
        networks=facts,
        freeze=dict(camera.freeze),
        plan=camera.plan,
        exported_with={name: metadata.version(name) for name in PACKAGES},
    )


def _on_frozen_grid(stage: Stage, freeze: Mapping[str, Any]) -> Stage:
    """Return a stage; a Wiener bank on the block grid that freezing chose by measured loss."""
    if not isinstance(stage, Wiener):
        return stage
    grid = {key: freeze[key] for key in ("block_px", "overlap_px") if key in freeze}
    return Wiener.model_validate({**stage.model_dump(), **grid})


def _plan_entries(parts: Parts) -> dict[str, Threshold] | None:
    """Read a calibration.

    Raises:
        ContractError: If the file holds anything else.
    """
    if parts.plan is None:
        return None
    try:
        entries = json.loads(read_side_text(parts.plan, "the calibration"))
        plan = {name: Threshold.model_validate(entry) for name, entry in entries.items()}
    except (ValueError, AttributeError, RecursionError) as error:
        raise ContractError(
            f"{parts.plan} is no calibration; make it with tools/plan_report.py calibrate"
        ) from error
    read_loss_model(plan)
    return plan


def _freeze_facts(parts: Parts) -> dict[str, Any]:
    if parts.freeze is None:
        return {}
    try:
        facts = json.loads(read_side_text(parts.freeze, "the facts of freezing"))
    except (json.JSONDecodeError, RecursionError) as error:
        raise ContractError(f"{parts.freeze} is no JSON of camkit freeze: {error}") from error
    if not isinstance(facts, dict):
        raise ContractError(f"{parts.freeze} is no JSON of camkit freeze: expected an object")
    return {k: v for k, v in facts.items() if isinstance(v, int | float | str)}
