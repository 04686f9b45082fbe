"""The networks of the tables behind other samplings, as one bundle that `camkit bench` reads.

    python -m tools.tables.spad.baselines --runs out/spad-tables -o NAME.camkit [--data PICTURES]

Each is a role of its own: low_fill, full_fill, gaussian of size M, srcnn and vdsr behind the plate.
VDSR must be named (`--roles`): at the thesis's size it takes 11 million operations for a pixel of
the array, more than `camkit check` admits unless CAMKIT_MAX_NETWORK_WORK and CAMKIT_MAX_PROOF_WORK
say so.
Weights are rounded to a few bits so that the file packs small; what that costs is measured on
pictures (procedural scenes without `--data`) and refused above 0.01 dB. The bundle holds no golden
cases and proves itself by `camkit check` before it gets its name.

References: Sun 2021, tables 4.1 and 4.2.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import nn

from camkit.arrays import FloatArray
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.frozen_optics import read_optics_file
from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.reader import CARD
from camkit.bundle.stages import Correct, Parts, Stage, SuperResolve
from camkit.bundle.writer import write_bundle
from camkit.colorimetry import encode_srgb, luma
from camkit.errors import CamkitError, ContractError, ParityError
from camkit.export.assemble import LICENCE, PACKAGES
from camkit.export.card import card_text
from camkit.export.network_facts import ExportedNetwork, draft_network, measure_network
from camkit.export.proving import write_proved
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.evaluation import evaluate, read_set
from camkit.models_def.kinds.spad.recipe import SpadRecipe
from camkit.models_def.kinds.spad.sampling import Sampling
from camkit.models_def.kinds.spad.training import PART, sampling_of
from camkit.models_def.training.checkpoint import load_network, read_checkpoint, recipe_of
from camkit.report.kinds.spad.ways import BASELINES
from camkit.runtime.kinds.spad.golden_captures import probe
from camkit.scenes import procedural_scene
from tools.tables.equal_training import checkpoint_of, finished
from tools.tables.spad.array_table import ROWS
from tools.tables.spad.array_training import ROLE, plate_file
from tools.tables.spad.edge_export import with_plain_borders
from tools.tables.table_rows import chosen_trainings

ROWS_OF_ROLES: Final = {
    "low_fill": "low_fill.M",
    "full_fill": "full_fill.M",
    "gaussian": "gaussian.M",
    "srcnn": "learned.srcnn",
    "vdsr": "learned.vdsr",
}
"""Role -> row of the tables."""
USUAL: Final = tuple(role for role in ROWS_OF_ROLES if role != "vdsr")
SIZE: Final = "M"
MANTISSA_BITS: Final = 10
MOST_LOSS_DB: Final = 0.01
LEVELS: Final = (float("inf"), 1000.0)
WINDOW_PX: Final = (160, 192)
"""Of what facts are measured on: a network at full resolution takes long."""
SCENES: Final = 3
VERSION: Final = "1.0.0"
MANTISSA: Final = 23


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """A trained network.

    Attributes:
        recipe: It was trained by.
        network: With rounded weights.
        sampling: WindowFinish which it was trained.
        loss_db: What rounding cost at worst.
        training_data: For people.
    """

    recipe: SpadRecipe
    network: nn.Module
    sampling: Sampling
    loss_db: float
    training_data: str

    def stage(self, role: str) -> SuperResolve:
        """Return its stage."""
        mode, plan = self.sampling.mode, self.recipe.sampling
        return SuperResolve(
            role=role,
            gives=(role,),
            sampling="plate" if mode == "learned" else mode,
            sigma=plan.sigma if mode == "gaussian" else None,
        )


def main(words: Sequence[str] | None = None) -> int:
    """Write the bundle and say what it holds.

    Raises:
        SystemExit: If something is missing; says what.
    """
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=Path, required=True, help="the --out-dir of the tables")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--data", type=Path, help="pictures to measure the rounding on")
    parser.add_argument("--roles", nargs="+", choices=list(ROWS_OF_ROLES), default=USUAL)
    parser.add_argument("--overwrite", action="store_true")
    arguments = parser.parse_args(words)
    try:
        if arguments.output.exists() and not arguments.overwrite:
            raise ContractError(f"{arguments.output} is there already: give --overwrite")
        lines = write_baselines(
            arguments.runs, arguments.roles, _pictures(arguments.data), arguments.output
        )
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    for line in lines:
        print(line)
    return 0


def write_baselines(
    runs: Path, roles: Iterable[str], pictures: Sequence[FloatArray], out: Path
) -> list[str]:
    """Pack and prove the bundle; nothing is written when a proof fails.

    Returns:
        What was written, for people.

    Raises:
        ContractError: If a network is not trained yet.
        ParityError: If rounding costs too much, or the bundle fails its check.
    """
    torch.set_num_threads(1)
    baselines_of = {role: read_baseline(runs, role, pictures) for role in roles}
    drafts = {
        role: draft_network(f"{role}_{SIZE}", one.network, PART.layout(one.recipe, ROLE))
        for role, one in baselines_of.items()
    }
    with tempfile.TemporaryDirectory() as folder:
        first = Path(folder) / "first.camkit"
        bundle = write_bundle(first, _manifest(baselines_of, drafts), _members(drafts))
        height, width = WINDOW_PX
        networks = {}
        for role, one in baselines_of.items():
            window = np.ascontiguousarray(probe(bundle, role)[None, :, :height, :width])
            networks[role] = _slim(measure_network(drafts[role], one.network, [window]))
        manifest, members = _manifest(baselines_of, networks), _members(networks)
        bundle = write_bundle(first, manifest, members)
        members[CARD] = card_text(bundle, {}).encode()
    _, report = write_proved(out, manifest, members)
    losses = [
        f"{role}: rounding costs {one.loss_db:.4f} dB at worst"
        for role, one in baselines_of.items()
    ]
    return [*report.lines(), *losses, f"{out}: {out.stat().st_size} bytes"]


def read_baseline(runs: Path, role: str, pictures: Sequence[FloatArray]) -> Baseline:
    """Read a trained network and round its weights; errors as of `write_baselines`."""
    one, *_ = chosen_trainings(ROWS, [ROWS_OF_ROLES[role]])
    if finished(runs / one.training) is None:
        raise ContractError(f"{one.training} is not trained yet: leave its role out (--roles)")
    path = checkpoint_of(runs, one)
    checkpoint = read_checkpoint(path)
    recipe = recipe_of(checkpoint)
    assert isinstance(recipe, SpadRecipe)
    sampling = sampling_of(recipe, PART.prepare(recipe, path.parent, path.parent))
    slim = {name: round_mantissa(value) for name, value in checkpoint.exported.items()}
    network = with_plain_borders(load_network(replace(checkpoint, average=slim)))
    loss_db = _loss_db(load_network(checkpoint), network, sampling, pictures)
    if loss_db > MOST_LOSS_DB:
        raise ParityError(f"rounding the weights of {role} costs {loss_db:.3f} dB")
    return Baseline(
        recipe=recipe,
        network=network,
        sampling=sampling,
        loss_db=loss_db,
        training_data=checkpoint.training_data,
    )


def round_mantissa(value: torch.Tensor, bits: int = MANTISSA_BITS) -> torch.Tensor:
    """Round float32 to so many bits of mantissa; other types stay."""
    if value.dtype != torch.float32:
        return value
    dropped = MANTISSA - bits
    whole = value.numpy().view(np.uint32).astype(np.uint64) + (1 << (dropped - 1))
    rounded = (whole >> dropped << dropped).astype(np.uint32)
    return torch.from_numpy(rounded.view(np.float32))


def _loss_db(
    exact: nn.Module, rounded: nn.Module, sampling: Sampling, pictures: Sequence[FloatArray]
) -> float:
    """Return what rounding costs at worst over the levels of light; a gain is as large a change."""
    changes = []
    for photons in LEVELS:
        exposure = Exposure(photons=photons)
        scores = [evaluate(pictures, sampling, exposure, net) for net in (exact, rounded)]
        changes.append(abs(scores[0].psnr_db - scores[1].psnr_db))
    return max(changes)


def _pictures(folder: Path | None) -> tuple[FloatArray, ...]:
    if folder is not None:
        return read_set(folder)
    scenes = (procedural_scene(seed, 128, 256) for seed in range(SCENES))
    return tuple(luma(encode_srgb(scene)) for scene in scenes)


def _slim(network: ExportedNetwork) -> ExportedNetwork:
    """Return a network without the graph in half precision."""
    facts = network.facts.model_copy(update={"fp16_member": None})
    return ExportedNetwork(facts=facts, members={facts.member: network.members[facts.member]})


def _members(networks: Mapping[str, ExportedNetwork]) -> dict[str, bytes]:
    optics = read_optics_file(plate_file(), channels=1)
    members = dict([optics.member])
    for network in networks.values():
        members |= network.members
    return members


def _manifest(
    baselines_of: Mapping[str, Baseline], networks: Mapping[str, ExportedNetwork]
) -> Manifest:
    recipe = next(iter(baselines_of.values())).recipe
    optics = read_optics_file(plate_file(), channels=1).entry(math.inf)
    facts: dict[str, dict[str, NetworkFacts]] = {
        role: {SIZE: network.facts} for role, network in networks.items()
    }
    stages: tuple[Stage, ...] = (
        Correct(),
        *(one.stage(role) for role, one in baselines_of.items()),
    )
    parts = Parts(sensor=recipe.sensor, optics=optics, networks=facts)
    data = dict.fromkeys(one.training_data for one in baselines_of.values())
    fields: dict[str, Any] = {
        "kind": recipe.kind,
        "name": BASELINES,
        "version": VERSION,
        "licence": LICENCE,
        "training_data": "; ".join(data),
        "sensor": recipe.sensor,
        "optics": optics,
        "stages": stages,
        "planes": planes_of(stages, parts),
        "products": {role: role for role in baselines_of},
        "networks": facts,
        "exported_with": {name: metadata.version(name) for name in PACKAGES},
    }
    return Manifest(**fields)


if __name__ == "__main__":
    sys.exit(main())
