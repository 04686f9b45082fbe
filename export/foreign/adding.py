"""A foreign network, its contract and a camera -> a bundle, proved before it is written.

graph, contract        -> obstacles, all of them                     (canonical, inspection)
pairs of the owner     -> held against the contract                  (own_pairs)
a first bundle         -> golden captures, inputs of the network     (golden_cases)
statistics             -> constants or local means, their cost       (global_statistics)
a second bundle        -> measured facts, outputs, laws, card
everything             -> `check_bundle` -> the bundle
"""

import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.facts import Card, NetworkFacts
from camkit.bundle.golden import IMAGE, GoldenArrays
from camkit.bundle.manifest import LIGHT_VERSION, Manifest, format_of, planes_of
from camkit.bundle.reader import CARD, GOLDEN, PREVIEW, Bundle
from camkit.bundle.stages import Parts, Stage
from camkit.bundle.writer import write_bundle
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.export.card import card_text, laws_text, picture_psnr_db, preview_png
from camkit.export.foreign.canonical import CanonicalGraph, canonical_graph, prove_equal
from camkit.export.foreign.contract import Contract
from camkit.export.foreign.global_statistics import (
    with_constants,
    with_local_means,
    with_residual,
)
from camkit.export.foreign.inspection import contract_obstacles, plain_facts
from camkit.export.foreign.onnx_file import ForeignModel
from camkit.export.foreign.own_pairs import prove_pairs, read_pairs
from camkit.export.foreign.wiring import ROLE, ports_of, stages_of
from camkit.export.golden_cases import (
    CaseRecipe,
    Cases,
    add_outputs,
    photograph,
    photograph_all,
)
from camkit.export.graph_measurements import arena_bytes, measured_of
from camkit.export.proving import golden_members, write_proved
from camkit.progress import Task, counted, working
from camkit.runtime.color import rec709_of_planes
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.graph_walk import GraphFacts
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.proof.laws.proof import MeasuredLaws, measure_laws, with_laws
from camkit.runtime.proof.one_window import prove_one_window

SIZE: Final = "M"
MEMBER: Final = f"{ROLE}_{SIZE}.onnx"
PACKAGES: Final = ("camkit", "numpy", "scipy", "onnx", "onnxruntime")
_NAME: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}")
_VERSION: Final = re.compile(r"[0-9]+\.[0-9]+\.[0-9]+(-[0-9A-Za-z.-]+)?")
_LIKE: Final = {"name": "my-camera_2", "version": "0.1.0"}
STEPS: Final = (
    "comparing the network with its canonical form",
    "comparing the network with pairs of its owner",
    "settling statistics of the whole picture",
    "measuring the network in the camera",
    "developing the golden cases",
    "measuring the laws of a picture",
    "proving the bundle",
    "comparing its pictures with those that are only developed",
)
"""Of `bundle_with_network`, as its progress shows them."""
_LEFT_OUT: Final = (CARD, PREVIEW, GOLDEN)
_CALIBRATION: Final = {
    f"calibration_{seed}": CaseRecipe(
        scene_seed=seed, exposure=exposure, iso=iso, field=field_, size_px=384
    )
    for seed, exposure, iso, field_ in (
        (40, 0.9, 100.0, 0.3),
        (41, 0.5, 400.0, 0.6),
        (42, 1.5, 100.0, 0.8),
        (43, 0.2, 800.0, 0.1),
        (44, 0.9, 1600.0, 0.5),
        (45, 0.05, 400.0, 0.4),
    )
}
_HELD_BACK: Final = {
    f"held_{seed}": CaseRecipe(
        scene_seed=seed, exposure=exposure, iso=iso, field=field_, size_px=384
    )
    for seed, exposure, iso, field_ in (
        (50, 0.8, 200.0, 0.5),
        (51, 1.2, 800.0, 0.2),
        (52, 0.3, 100.0, 0.7),
    )
}
_PROBE: Final = CaseRecipe(scene_seed=30, exposure=0.9, iso=400.0, field=0.6, size_px=512)


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """The name of the new bundle, and what is known of its weights.

    Attributes:
        name: Of the camera; None for that of the file.
        version: Semantic version.
        licence: Of the weights.
        training_data: What they were trained on.
    """

    name: str | None = None
    version: str = "0.1.0"
    licence: str = "not stated"
    training_data: str = "not stated"


@dataclass(slots=True, kw_only=True)
class _Draft:
    """A bundle in the making; `task` shows its steps."""

    task: Task
    camera: Bundle
    contract: Contract
    label: Label
    out: Path
    model: ForeignModel
    data: bytes
    canonical: CanonicalGraph
    report: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def bundle_with_network(
    model: ForeignModel,
    contract: Contract,
    camera: Bundle,
    out: Path,
    label: Label | None = None,
) -> dict[str, Any]:
    """Add a network to a copy of a camera's bundle and prove it.

    Args:
        model: The network, decoded.
        contract: What it takes and gives.
        camera: Its own networks are left out.
        out: Bundle to write.
        label: What it is called.

    Returns:
        What was shown, flat; `warnings` is a list.

    Raises:
        UnsupportedError: If operators of the network cannot be taken; names all of them.
        ContractError: If network, contract and camera do not go together; names all of it.
        ParityError: If a proof fails; nothing is written then.
    """
    with working(STEPS[0], len(STEPS), is_even=False) as task:
        return _added(task, model, contract, camera, out, label or Label())


def _added(
    task: Task, model: ForeignModel, contract: Contract, camera: Bundle, out: Path, label: Label
) -> dict[str, Any]:
    canonical = canonical_graph(model)
    _refuse(canonical, contract)
    data = canonical.model
    if contract.residual != "none":
        subtracted = contract.residual == "subtracted"
        data = with_residual(data, contract.plane_channels, subtracted=subtracted)
    for what, text, pattern in (
        ("name", label.name or out.stem, _NAME),
        ("version", label.version, _VERSION),
    ):
        if not pattern.fullmatch(text):
            raise ContractError(f"{option_text(what)} must read like {_LIKE[what]}; got {text!r}")
    draft = _Draft(
        task=task,
        camera=camera,
        contract=contract,
        label=label,
        out=out,
        model=model,
        data=data,
        canonical=canonical,
    )
    draft.report["canonical_difference"] = canonical.difference
    if canonical.half_difference is not None:
        draft.report["half_precision_difference"] = canonical.half_difference
    _hold_pairs(draft)
    with tempfile.TemporaryDirectory() as folder:
        _settle_statistics(draft, Path(folder))
        return _packed(draft, Path(folder))


def _refuse(canonical: CanonicalGraph, contract: Contract) -> None:
    findings = contract_obstacles(canonical.facts, contract)
    if canonical.facts.global_operators and contract.mode == "refuse":
        names = ", ".join(canonical.facts.global_operators[:3])
        findings.append(
            f"the network looks at the whole picture ({names}, "
            f"{len(canonical.facts.global_operators)} in all), so tiles would differ from the "
            'whole: state [global] mode = "constants" (frozen on calibration pictures), "local:N" '
            '(means of N px around) or "whole" (one window)'
        )
    if findings:
        raise ContractError("; ".join(findings))


def _begin(task: Task, number: int) -> None:
    """Show that a step is in progress."""
    task.count(number)
    task.tell(STEPS[number])


def _hold_pairs(draft: _Draft) -> None:
    """Compare with the owner's own pairs, where there are any."""
    contract = draft.contract
    _begin(draft.task, 1)
    if contract.pairs is None:
        draft.warnings.append(
            "no pairs of your own script were given, so a wrong order, range or curve in the "
            "contract would not be seen"
        )
        return
    facts = inspect_graph(draft.data)
    sensor = draft.camera.manifest.light_sensor
    colours = None if sensor.color_matrix is None else np.array(sensor.color_matrix)
    draft.report["pairs_difference"] = prove_pairs(
        read_pairs(contract.pairs),
        contract,
        draft.data,
        matrix=rec709_of_planes(colours),
        scale=facts.output_scale,
        stride_px=facts.stride_px,
    )


def _settle_statistics(draft: _Draft, folder: Path) -> None:
    """Freeze means over the picture or make them local, and measure what that costs."""
    contract, facts = draft.contract, inspect_graph(draft.data)
    _begin(draft.task, 2)
    if not facts.global_operators:
        return
    whole = _trial(draft, folder / "whole.camkit")
    if contract.mode == "whole":
        draft.report["global_mode"] = prove_one_window(whole, ROLE, SIZE)
        return
    if contract.mode == "local":
        draft.data = with_local_means(draft.data, contract.local_px)
    else:
        cases = _photographed(whole, _CALIBRATION)
        draft.data = with_constants(draft.data, _inputs(whole, cases))
    changed = _trial(draft, folder / "changed.camkit")
    held_back = _photographed(whole, _HELD_BACK)
    before, after = (_mean_db(bundle, held_back) for bundle in (whole, changed))
    draft.report |= {
        "global_mode": contract.mode if contract.mode != "local" else f"local:{contract.local_px}",
        "db_whole": round(before, 3),
        "db_changed": round(after, 3),
        "statistics_cost_db": round(before - after, 3),
    }


def _trial(draft: _Draft, path: Path) -> Bundle:
    """Return a bundle with the network as it stands, nothing measured."""
    graph = inspect_graph(draft.data)
    manifest = _manifest(draft, _facts(draft, graph, {}))
    return write_bundle(path, manifest, _members(draft))


def _facts(draft: _Draft, graph: GraphFacts, measured: Mapping[str, Any]) -> NetworkFacts:
    inputs, outputs = ports_of(draft.contract, graph.output_channels, graph.output_scale)
    changes = {
        "member": MEMBER,
        "inputs": inputs,
        "outputs": outputs,
        "bytes_per_pixel": arena_bytes(graph),
        "parity_max_abs": draft.canonical.difference,
    }
    return plain_facts(graph, **(changes | dict(measured)))


def _members(draft: _Draft) -> dict[str, bytes]:
    """Return the camera's members without its networks, and the new one."""
    camera = draft.camera
    networks = {
        name
        for sizes in camera.manifest.networks.values()
        for facts in sizes.values()
        for name in (facts.member, facts.fp16_member)
    }
    remaining = [name for name in camera.names if name not in networks and name not in _LEFT_OUT]
    return {name: camera.member(name) for name in remaining} | {MEMBER: draft.data}


def _manifest(draft: _Draft, facts: NetworkFacts) -> Manifest:
    camera, label = draft.camera.manifest, draft.label
    stages: tuple[Stage, ...] = stages_of(draft.contract, camera, facts.output_channels)
    networks = {ROLE: {SIZE: facts}}
    parts = Parts(sensor=camera.sensor, optics=camera.optics, networks=networks)
    planes = planes_of(stages, parts)
    image = stages[-1].gives[0]
    psf = draft.camera.psf if camera.has_kernels else None
    entries = (*stages, *([] if camera.optics is None else [camera.optics]))
    least = max(LIGHT_VERSION, camera.version_pair)
    return Manifest(
        format_version=format_of(psf, entries, least=least),
        kind=camera.kind,
        name=label.name or draft.out.stem,
        version=label.version,
        licence=label.licence,
        training_data=label.training_data,
        sensor=camera.sensor,
        optics=camera.optics,
        border=camera.border,
        stages=stages,
        planes=planes,
        products={IMAGE: image},
        networks=networks,
        card=Card(),
        freeze=dict(camera.freeze),
        exported_with={name: metadata.version(name) for name in PACKAGES},
    )


def _photographed(bundle: Bundle, recipes: Mapping[str, CaseRecipe]) -> Cases:
    cases: Cases = {}
    for name, recipe in counted(list(recipes.items()), "photographing", "captures"):
        case, capture, reference = photograph(name, recipe, bundle)
        cases[name] = case, GoldenArrays(capture=capture, reference=reference)
    return cases


def _inputs(bundle: Bundle, cases: Cases) -> list[FloatArray]:
    """Return what the network of a bundle is given for some captures, cut to its stride."""
    stride = bundle.network_facts(ROLE, SIZE).stride_px
    windows = []
    for case, arrays in cases.values():
        planes = case_work(bundle, case, arrays, SIZE).network_input(ROLE)
        height, width = (side // stride * stride for side in planes.shape[1:])
        windows.append(np.ascontiguousarray(planes[:, :height, :width])[None])
    return windows


def _mean_db(bundle: Bundle, cases: Cases, method: str | None = None) -> float:
    """Return the PSNR of some captures against their scenes, in dB of sRGB values."""
    values = []
    for case, arrays in counted(list(cases.values()), "developing", "captures"):
        pipeline = Pipeline(bundle, Options(threads=1, method=method))
        capture = pipeline.capture_of(
            np.ascontiguousarray(arrays.capture),
            iso=case.iso,
            white_balance=case.white_balance,
            origin_px=case.origin_px,
        )
        picture = pipeline.start(capture).fill()
        values.append(picture_psnr_db(picture, arrays.reference))
    return float(np.mean(values))


def _packed(draft: _Draft, folder: Path) -> dict[str, Any]:
    """Measure, prove and write the bundle."""
    graph = inspect_graph(draft.data)
    _begin(draft.task, 3)
    first = _trial(draft, folder / "first.camkit")
    cases = photograph_all(first)
    probe = _photographed(first, {"probe": _PROBE})
    windows = _inputs(first, probe | cases)
    difference, _ = prove_equal(
        draft.model, draft.canonical.model, draft.canonical.facts, tuple(windows)
    )
    draft.report["canonical_difference"] = difference
    measured = measured_of(draft.data, graph, windows)
    facts = _facts(draft, graph, {"parity_max_abs": difference, **measured})
    manifest, members = _manifest(draft, facts), _members(draft)
    second = write_bundle(folder / "second.camkit", manifest, members)
    _begin(draft.task, 4)
    golden = add_outputs(second, cases)
    members |= golden_members(second, golden)
    manifest = manifest.model_copy(update={"golden": tuple(case for case, _ in cases.values())})
    third = write_bundle(folder / "third.camkit", manifest, members)
    _begin(draft.task, 5)
    laws = measure_laws(third)
    manifest = with_laws(manifest, laws)
    if manifest.has_kernels:
        members[CARD] = (card_text(second, golden) + laws_text(laws)).encode()
        members[PREVIEW] = preview_png(second, golden)
    draft.out.parent.mkdir(parents=True, exist_ok=True)
    _begin(draft.task, 6)
    bundle, report = write_proved(draft.out, manifest, members)
    _judge(draft, bundle, cases, laws)
    return {
        "bundle": str(draft.out),
        "bytes": draft.out.stat().st_size,
        "format": manifest.format_version,
        **draft.report,
        **{f"check {i}": line for i, line in enumerate(report.lines())},
        "warnings": draft.warnings,
    }


def _judge(draft: _Draft, bundle: Bundle, cases: Cases, laws: MeasuredLaws) -> None:
    """Compare the pictures with those that are only developed; warn of worse ones."""
    _begin(draft.task, 7)
    before, after = _mean_db(draft.camera, cases, DEVELOP), _mean_db(bundle, cases)
    draft.report |= {"developed_db": round(before, 2), "network_db": round(after, 2)}
    if draft.camera.manifest.networks:
        draft.report["camera_network_db"] = round(_mean_db(draft.camera, cases), 2)
    if after < before:
        draft.warnings.append(
            f"on the simulated camera the network makes pictures of {after:.2f} dB, developing "
            f"alone {before:.2f} dB: it is worse than its own input"
        )
    if isinstance(laws, str):
        return
    broken = [law.describe() for sizes in laws.values() for law in sizes if not law.is_kept]
    if broken:
        draft.warnings.append("laws of a picture that it does not keep: " + "; ".join(broken))
