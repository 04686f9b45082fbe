"""What the thesis's networks and those beside them cost: parameters, and multiplications per pixel.

    python -m tools.hdr.network_costs -o docs/results/thesis-networks.json

Shapes alone are computed, no values. Multiplications are those of convolutions, as torch's counter
finds them; they hold on any machine. `--measure` also runs the splitting network on a picture in
both orders, and prints CPU-seconds of one thread and the largest difference; that is not stored.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Final

import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from camkit.models_def.kinds.hdr.thesis.chain import ThesisChain
from camkit.models_def.kinds.hdr.thesis.fusion import FusionNetwork
from camkit.models_def.kinds.hdr.thesis.highlight import HighlightUnet
from camkit.models_def.kinds.hdr.thesis.splitting import SplittingConfig, SplittingNetwork
from camkit.models_def.networks.catalog import build_network

SIDE_PX: Final = 256
FLOPS_PER_MAC: Final = 2


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--measure", action="store_true")
    arguments = parser.parse_args()
    found = all_costs()
    print("| network | parameters | trained | kMAC/pixel |")
    print("|---|---|---|---|")
    for name, cost in found.items():
        row = f"{cost['parameters']:,} | {cost['trained']:,} | {cost['kmac_per_px']:.1f}"
        print(f"| {name} | {row} |")
    if arguments.measure:
        early, late, difference = compare_orders(SIDE_PX)
        print(f"early {early:.2f} s, late {late:.2f} s of CPU; they differ by {difference:.1e}")
    if arguments.output is not None:
        arguments.output.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def all_costs() -> dict[str, dict[str, float]]:
    """Return the cost of every network by its name."""
    with torch.device("meta"):
        picture = torch.zeros(1, 3, SIDE_PX, SIDE_PX)
        return {
            "splitting": cost(SplittingNetwork(), picture),
            "splitting, 1x1 behind the upsampling": cost(
                SplittingNetwork(SplittingConfig(early=False)), picture
            ),
            "highlight": cost(HighlightUnet(), picture),
            "fusion": cost(FusionNetwork(), picture, picture),
            "all three": cost(ThesisChain(), picture),
            "constant_unet": cost(build_network("constant_unet", in_channels=3), picture),
            "lights_s": cost(build_network("lights_s"), torch.cat([picture, picture], dim=1)),
            "lights_m": cost(build_network("lights_m"), torch.cat([picture, picture], dim=1)),
        }


def compare_orders(side_px: int) -> tuple[float, float, float]:
    """Return the CPU-seconds of the early and the late 1x1 and their largest difference."""
    torch.set_num_threads(1)
    torch.manual_seed(1)
    early = SplittingNetwork().eval()
    late = SplittingNetwork(SplittingConfig(early=False)).eval()
    nn.init.normal_(early.last.weight, std=0.1)
    late.load_state_dict(early.state_dict())
    picture = torch.rand(1, 3, side_px, side_px)
    seconds, found = [], []
    with torch.no_grad():
        for network in (early, late):
            start = time.process_time()
            found.append(torch.cat(network(picture), dim=1))
            seconds.append(time.process_time() - start)
    return seconds[0], seconds[1], float((found[0] - found[1]).abs().max())


def cost(network: nn.Module, *pictures: Tensor) -> dict[str, float]:
    """Return parameters, those that are trained, and thousands of multiplications per pixel."""
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network(*pictures)
    pixels = pictures[0].shape[-2] * pictures[0].shape[-1]
    macs = counter.get_total_flops() / FLOPS_PER_MAC
    return {
        "parameters": sum(p.numel() for p in network.parameters()),
        "trained": sum(p.numel() for p in network.parameters() if p.requires_grad),
        "kmac_per_px": round(macs / pixels / 1000, 3),
    }


if __name__ == "__main__":
    main()
