"""Only what torch wrote is read; anything else is one line."""

from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.torch_file import load_torch


def test_tensors_and_plain_values_come_back(tmp_path: Path) -> None:
    torch.save({"a": torch.ones(2), "b": [1, "x"]}, tmp_path / "x.pt")
    found = load_torch(tmp_path / "x.pt", "thing")
    assert torch.equal(found["a"], torch.ones(2))
    assert found["b"] == [1, "x"]


@pytest.mark.parametrize(
    "data",
    [b"", b"junk\n", b"\x80", b"PK\x03\x04", b"\x80\x02}q\x00.", b"}", b"(", b"I1\n", b"\x00" * 99],
)
def test_what_torch_did_not_write_is_refused_in_one_line(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.pt"
    path.write_bytes(data)
    with pytest.raises(ContractError, match=r"x\.pt is no thing: ") as caught:
        load_torch(path, "thing")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="cannot read thing"):
        load_torch(tmp_path / "x.pt", "thing")
