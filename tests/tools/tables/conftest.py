"""The tables by their command line; an answer is what it prints."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import torch

from tools.tables.__main__ import TABLES
from tools.tables.runner import run


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Iterator[Callable[..., str]]:
    """Run the command of a table and return what it prints; the threads of torch stay."""
    before = torch.get_num_threads()

    def called(*words: Any) -> str:
        run(TABLES, [str(word) for word in words])
        return capsys.readouterr().out

    yield called
    torch.set_num_threads(before)
