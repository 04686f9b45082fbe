"""A camera with the generator of chapter 3 in place of its networks, its weights random: for time.

    python -m tools.comparison.random_generator duet --width 64 -o runs/generator64.camkit
    camkit bench duet --reference runs/generator64.camkit

Seconds and memory do not depend on weights. Norms are constants, of noise. The bundle says
`not trained`, so the bench times it and does not judge it; a generator that was trained and frozen
(`camkit freeze-norms`) is exported as any network is, and judged.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import torch
from torch import nn

from camkit.bundle.facts import Card
from camkit.bundle.manifest import NOT_TRAINED
from camkit.bundle.reader import GOLDEN, Bundle, find_bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import CamkitError, ContractError
from camkit.export.network_facts import ExportedNetwork, draft_network
from camkit.models_def.kinds.bayer.samples import LAYOUT
from camkit.models_def.networks.instance_norm import freeze_norms
from camkit.models_def.networks.normed_unet import NormedConfig, NormedUnet

SEED: Final = 64
CALIBRATION_STRIDES: Final = 4
"""Sides of the picture of noise that norms are frozen with, in strides of the network."""


def random_generator(config: NormedConfig) -> ExportedNetwork:
    """Return a generator with random weights and frozen norms, exported.

    Args:
        config: Its shape; whether norms are frozen does not matter.
    """
    torch.manual_seed(SEED)
    live, frozen = (NormedUnet(replace(config, frozen=kept)).eval() for kept in (False, True))
    nn.init.normal_(torch.as_tensor(live.tail[-1].weight), std=1e-3 * config.width**-0.5)
    side = CALIBRATION_STRIDES * live.stride_px
    freeze_norms(live, frozen, [torch.rand(1, config.in_channels, side, side)])
    return draft_network(f"generator_{config.width}", frozen, LAYOUT)


def with_generator(bundle: Bundle, config: NormedConfig, path: Path) -> None:
    """Write a camera whose only network is a random generator.

    Args:
        bundle: The camera; its network takes capture and bank.
        config: Shape of the generator.
        path: File to write.

    Raises:
        ContractError: If the camera has no such network.
    """
    manifest = bundle.manifest
    roles = list(manifest.networks.items())
    if len(roles) != 1 or any(f.input_channels != config.in_channels for f in roles[0][1].values()):
        raise ContractError(
            f"{manifest.name} has no network of {config.in_channels} planes in one role"
        )
    (role, sizes), made = roles[0], random_generator(config)
    left = {GOLDEN, *(f.member for f in sizes.values()), *(f.fp16_member for f in sizes.values())}
    members = {name: bundle.member(name) for name in bundle.names if name not in left}
    changes = {
        "networks": {role: {f"G{config.width}": made.facts}},
        "training_data": NOT_TRAINED,
        "golden": (),
        "card": Card(),
        "plan": None,
        "envelope": None,
    }
    write_bundle(path, manifest.model_copy(update=changes), members | made.members)


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the bundle that the arguments name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bundle")
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--capture-only", action="store_true")
    parser.add_argument("-o", "--out", type=Path, required=True)
    asked = parser.parse_args(arguments)
    config = NormedConfig(width=asked.width, capture_only=asked.capture_only)
    try:
        with_generator(open_bundle(find_bundle(asked.bundle)), config, asked.out)
    except CamkitError as error:
        raise SystemExit(f"{error}") from error
    print(asked.out)


if __name__ == "__main__":
    main()
