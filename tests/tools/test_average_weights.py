"""Weights between two ends, on checkpoints of a tiny network."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.training.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from tests.bayer_recipe import recipe_path  # noqa: F401
from tools import average_weights


@pytest.fixture
def end(recipe_path: Path) -> Checkpoint:  # noqa: F811
    """Return a checkpoint whose best weights are not its last ones."""
    best = {"a": torch.tensor([4.0, 8.0]), "b": torch.zeros(2, 2)}
    return Checkpoint(
        recipe_toml=recipe_path.read_text(encoding="utf-8"),
        size="M",
        network="lean_m",
        config={},
        bank_digest="",
        training_data="pictures",
        step=1,
        elapsed_s=1.0,
        cpu_s=1.0,
        valid_db=20.0,
        weights={name: weight + 1 for name, weight in best.items()},
        average={name: weight + 1 for name, weight in best.items()},
        optimizer={},
        best=best,
        best_db=21.0,
    )


def test_the_file_lies_between_both_ends(end: Checkpoint, tmp_path: Path) -> None:
    start = {"a": torch.tensor([0.0, 4.0]), "b": torch.ones(2, 2)}
    write_checkpoint(tmp_path / "end.pt", end)
    write_checkpoint(tmp_path / "start.pt", replace(end, best={}, average=start))
    words = ["--start", str(tmp_path / "start.pt"), "--share", "0.75", "-o", str(tmp_path / "o.pt")]
    average_weights.main([str(tmp_path / "end.pt"), *words])
    exported = read_checkpoint(tmp_path / "o.pt").exported
    assert exported["a"].tolist() == [3.0, 7.0]
    assert exported["b"].tolist() == [[0.25, 0.25], [0.25, 0.25]]


def test_another_network_and_another_share_are_refused(end: Checkpoint) -> None:
    with pytest.raises(ContractError, match="another network: a, b differ"):
        average_weights.part_of_the_way({}, end, 0.5)
    with pytest.raises(ContractError, match="another network: b differ"):
        average_weights.part_of_the_way(end.best | {"b": torch.zeros(3)}, end, 0.5)
    with pytest.raises(ContractError, match=r"0 to 1; got 1\.5"):
        average_weights.part_of_the_way(end.best, end, 1.5)
