"""The proof of a bundle in the making: golden cases, activations, its check."""

import tempfile
from collections.abc import Mapping
from pathlib import Path

from camkit.bundle.facts import NetworkFacts
from camkit.bundle.golden import GoldenArrays, golden_to_bytes
from camkit.bundle.haze_golden import haze_golden_to_bytes
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import GOLDEN, HAZE_GOLDEN, Bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ParityError
from camkit.export.golden_cases import HAZE_SCENE, Cases
from camkit.runtime.network.ranges import node_activations
from camkit.runtime.proof.check import CheckReport, check_bundle
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.proof.haze_band import make_haze_golden


def golden_members(bundle: Bundle, golden: Mapping[str, GoldenArrays]) -> dict[str, bytes]:
    """Return the members that hold golden cases, that of a haze among them where there is one."""
    members = {GOLDEN: golden_to_bytes(golden)}
    if bundle.manifest.has_haze:
        members[HAZE_GOLDEN] = haze_golden_to_bytes(make_haze_golden(bundle, HAZE_SCENE))
    return members


def with_activations(bundle: Bundle, cases: Cases) -> dict[str, dict[str, NetworkFacts]]:
    """Return the facts of its networks, with activations that hold for the golden cases too."""
    networks: dict[str, dict[str, NetworkFacts]] = {}
    for role, sizes in bundle.manifest.networks.items():
        networks[role] = {}
        for size, facts in sizes.items():
            windows = [
                case_work(bundle, case, arrays, size).network_input(role)[None]
                for case, arrays in cases.values()
            ]
            activations = node_activations(bundle.network_bytes(role, size), windows)
            earlier = facts.node_activation
            largest = {
                name: max(value, earlier.get(name, 0.0)) for name, value in activations.items()
            }
            top = max(facts.max_activation, *largest.values())
            networks[role][size] = facts.model_copy(
                update={"node_activation": largest, "max_activation": top}
            )
    return networks


def write_proved(
    out: Path, manifest: Manifest, members: Mapping[str, bytes]
) -> tuple[Bundle, CheckReport]:
    """Write a bundle that passes its check; its laws are measured elsewhere.

    Raises:
        BundleError: If a reader would refuse it.
        ParityError: If it fails its check; nothing is written then.
    """
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / out.name
        write_bundle(trial, manifest, members)
        report = check_bundle(trial, run=case_work, left_out=("laws",))
    if not report.passed:
        raise ParityError("the bundle fails its own check: " + "; ".join(report.lines()))
    return write_bundle(out, manifest, members), report
