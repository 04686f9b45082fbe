"""`camkit check`: a bundle proves what it says about itself, layer by layer.

    schema   the zip and its manifest; its kind is installed, its stages stay within the limits
    hash     every member, the PSF
    graph    every network: operators, shapes, reach, stride, cost
    golden   the stored cases come out again
    tiling   tiled == whole, bit for bit; no pixel acts further than the stated reach
    range    activations stay where they were measured, and in fp16 where that is claimed
    laws     pictures keep their light: white, even areas, exposure, zones, borders

A layer whose ground failed is skipped, and says so.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

from camkit.bundle.container import read_container
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.optics import PSF
from camkit.bundle.reader import Bundle, open_bundle, read_container_manifest
from camkit.errors import CamkitError, ContractError, one_line
from camkit.progress import working
from camkit.psf import depth_name
from camkit.runtime.device.case_results import GoldenRun
from camkit.runtime.kind import part_of
from camkit.runtime.network.graph import COST_RTOL, check_graph
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES
from camkit.runtime.proof.laws.proof import BrokenLawsError, prove_laws
from camkit.runtime.proof.layers import prove_golden, prove_range, prove_tiling
from camkit.runtime.stage_finder import check_stages

LAYERS: Final = ("schema", "hash", "graph", "golden", "tiling", "range", "laws")
Status = Literal["pass", "fail", "skip"]
_GROUND: Final = ("schema", "hash", "graph")
Facts = Sequence[Mapping[str, Any]]
Result = tuple[bool, str] | tuple[bool, str, Facts]
"""Whether something was shown, what, and for programs every number of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """The result of one layer."""

    name: str
    status: Status
    message: str
    facts: Sequence[Mapping[str, Any]] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckReport:
    """The results of a check, in the order of the layers."""

    path: Path
    layers: tuple[Layer, ...]

    @property
    def passed(self) -> bool:
        """Return whether no layer failed."""
        return all(layer.status != "fail" for layer in self.layers)

    def lines(self) -> list[str]:
        """Return one line per layer, for people."""
        return [f"{layer.status:4}  {layer.name:7} {layer.message}" for layer in self.layers]

    def to_json(self) -> dict[str, Any]:
        """Return plain data, for programs."""
        return {
            "bundle": str(self.path),
            "passed": self.passed,
            "layers": [
                {"name": layer.name, "status": layer.status, "message": layer.message}
                | ({"laws": list(layer.facts)} if layer.facts else {})
                for layer in self.layers
            ],
        }


def check_bundle(
    path: Path,
    level: str = "all",
    *,
    run: GoldenRun | None = None,
    threads: int = 1,
    left_out: Collection[str] = (),
) -> CheckReport:
    """Check a bundle.

    Args:
        path: The .camkit file.
        level: "all", or one layer, which is checked with those it stands on (schema, hash and
            graph).
        run: The pipeline, for the golden cases; without it networks are proved on noise alone.
        threads: Threads per run of a network.
        left_out: Layers that are left out of "all".

    Raises:
        ContractError: If the level is unknown.
    """
    if level not in ("all", *LAYERS):
        raise ContractError(f"level must be all or one of {', '.join(LAYERS)}; got {level!r}")
    selected = LAYERS if level == "all" else _layers_to(level)
    proofs: dict[str, Callable[[Bundle], Result]] = {
        "hash": _prove_hashes,
        "graph": _prove_graphs,
        "golden": lambda bundle: prove_golden(bundle, run=run),
        "tiling": lambda bundle: prove_tiling(bundle, run=run, threads=threads),
        "range": lambda bundle: prove_range(bundle, run=run),
        "laws": lambda bundle: prove_laws(bundle, threads=threads),
    }
    layers = [_layer("schema", lambda: (True, _describe(Path(path))))]
    opened: list[Bundle] = []
    names = [name for name in selected[1:] if name not in left_out]
    with working(f"checking {Path(path).name}", len(names), is_even=False) as task:
        for number, name in enumerate(names):
            task.count(number)
            task.tell(f"checking {name} of {Path(path).name}")
            failed = [one.name for one in layers if one.status == "fail" and one.name in _GROUND]
            if failed:
                layers.append(Layer(name=name, status="skip", message=f"needs {failed[0]}"))
            else:
                layers.append(_layer(name, partial(_prove, proofs[name], Path(path), opened)))
    return CheckReport(path=Path(path), layers=tuple(layers))


def _layers_to(level: str) -> tuple[str, ...]:
    ground = _GROUND[: _GROUND.index(level)] if level in _GROUND else _GROUND
    return (*ground, level)


def _prove(proof: Callable[[Bundle], Result], path: Path, opened: list[Bundle]) -> Result:
    """Run a proof on the bundle, which is opened once for all of them."""
    if not opened:
        opened.append(open_bundle(path))
    return proof(opened[0])


def _layer(name: str, prove: Callable[[], Result]) -> Layer:
    facts: Sequence[Mapping[str, Any]] = ()
    try:
        proved, message, *more = prove()
        facts = more[0] if more else ()
    except BrokenLawsError as error:
        return Layer(name=name, status="fail", message=str(error), facts=error.facts)
    except CamkitError as error:
        return Layer(name=name, status="fail", message=str(error))
    except MemoryError:
        text = "out of memory: the bundle asks for more than this machine has free"
        return Layer(name=name, status="fail", message=text)
    status: Status = "pass" if proved else "skip"
    return Layer(name=name, status=status, message=one_line(message), facts=facts)


def _describe(path: Path) -> str:
    manifest = read_container_manifest(read_container(path))
    part_of(manifest)  # its kind is installed
    check_stages(manifest, DEFAULT_MAX_MEM_BYTES)
    sizes = ", ".join(manifest.sizes) or "none"
    return (
        f"{manifest.name} {manifest.version}, format {manifest.format_version}, "
        f"{len(manifest.members)} members, networks {sizes}"
    )


def _prove_hashes(bundle: Bundle) -> tuple[bool, str]:
    text = f"{len(bundle.names)} members as stated; bundle sha256 {bundle.sha256[:16]}"
    if PSF in bundle.names:
        text += f"; objects at {', '.join(map(depth_name, bundle.psf.depths_mm))}"
    return True, text


def _prove_graphs(bundle: Bundle) -> tuple[bool, str]:
    networks = bundle.manifest.networks
    if not networks:
        return False, "no network"
    notes = []
    for role, sizes in networks.items():
        for size, facts in sizes.items():
            what = size if len(networks) == 1 else f"{size} ({role})"
            notes.append(f"{what}: {_prove_graph(bundle, (role, size), facts)}")
    return True, "; ".join(notes)


def _prove_graph(bundle: Bundle, which: tuple[str, str], facts: NetworkFacts) -> str:
    graph = check_graph(bundle.network_bytes(*which), facts)
    costs = {
        "mac_per_pixel": (graph.mac_per_pixel, facts.mac_per_pixel),
        "parameters": (float(graph.parameters), float(facts.parameters)),
    }
    for name, (got, expected) in costs.items():
        if abs(got - expected) > COST_RTOL * expected:
            raise ContractError(
                f"{facts.member}: {name} is {got:g}, the manifest says {expected:g}"
            )
    if facts.fp16_member is not None:
        check_graph(bundle.network_bytes(*which, fp16=True), facts)
    text = (
        f"halo {graph.receptive_field_radius_px} px, stride {graph.stride_px}, "
        f"{graph.mac_per_pixel / 1000:.3g} kMAC/px"
    )
    if graph.unblocked_convolutions:
        text += f", off the blocked path: {', '.join(graph.unblocked_convolutions)}"
    return text
