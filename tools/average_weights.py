"""Weights between those that a training began with and those that it ended with.

    python -m tools.average_weights runs/duet/duet_M.pt --start duet --share 0.65 -o OUT.pt

A network that is trained further gains on the pictures that it is trained on, and may leave laws
that it kept. Between both ends of a short training lie networks nearly as good as the last one
that still keep what the first one kept: `camkit export` states which laws they keep.

References: Wortsman et al. 2022, Robust fine-tuning of zero-shot models.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from camkit.errors import CamkitError, ContractError
from camkit.models_def.training.checkpoint import (
    Checkpoint,
    State,
    read_checkpoint,
    write_checkpoint,
)
from camkit.models_def.training.first_weights import read_first_weights


def main(words: Sequence[str] | None = None) -> None:
    """Write a checkpoint whose exported weights lie between two others."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkpoint", type=Path, help="of camkit train: the end")
    parser.add_argument("--start", type=Path, required=True, help="as of camkit train: the start")
    parser.add_argument("--share", type=float, required=True, help="of the end, 0 to 1")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    try:
        end = read_checkpoint(arguments.checkpoint)
        start = read_first_weights(arguments.start, end.size, end.role).state
        write_checkpoint(arguments.output, part_of_the_way(start, end, arguments.share))
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error


def part_of_the_way(start: State, end: Checkpoint, share: float) -> Checkpoint:
    """Return a checkpoint whose exported weights are share * end + (1 - share) * start.

    Raises:
        ContractError: If the share lies outside 0 to 1, or both are not of one network.
    """
    if not 0 <= share <= 1:
        raise ContractError(f"the share must be 0 to 1; got {share:g}")
    unlike = (start.keys() ^ end.exported.keys()) or {
        name for name in start if start[name].shape != end.exported[name].shape
    }
    if unlike:
        raise ContractError(f"the start is another network: {', '.join(sorted(unlike)[:3])} differ")
    state = {
        name: share * weight + (1 - share) * start[name].to(weight.dtype)
        for name, weight in end.exported.items()
    }
    return replace(end, average=state, best=state)


if __name__ == "__main__":
    main()
