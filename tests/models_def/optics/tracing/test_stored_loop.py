from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.tracing.stored_loop import StoredLoop, layout_of, stored_path

KEY = ("forward", 3)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def _double(*columns: torch.Tensor) -> tuple[torch.Tensor, ...]:
    return (2 * columns[0] + columns[1],)


def _untraceable(*_: torch.Tensor) -> tuple[torch.Tensor, ...]:
    raise AssertionError("a loop that was read is traced")


class _Compiled:
    """The plain function, which cannot be stored."""

    def __init__(self, function: Callable[..., tuple[torch.Tensor, ...]], **_: object) -> None:
        self._function = function

    def __call__(self, *columns: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return self._function(*columns)

    def aot_compile(self, _: object) -> None:
        raise RuntimeError("no storing here")


@pytest.mark.parametrize("content", [None, b"no loop"])
def test_what_cannot_be_stored_or_read_is_compiled(
    content: bytes | None, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch, "compile", _Compiled)
    path = stored_path(KEY, "loop")
    assert path.is_relative_to(cache)
    if content is not None:
        path.parent.mkdir(parents=True)
        path.write_bytes(content)
    one, two = torch.arange(5.0), torch.ones(5)
    for _ in range(2):
        assert torch.equal(StoredLoop(_double, KEY)(one, two)[0], 2 * one + 1)


@pytest.mark.usefixtures("cache")
def test_loops_of_other_lenses_have_other_files() -> None:
    layouts = [layout_of([torch.zeros(n, dtype=t)]) for n in (3, 4) for t in (None, torch.float64)]
    assert len({stored_path((*KEY, layout), "loop") for layout in layouts}) == len(layouts)
    assert stored_path(KEY, "loop") == stored_path(KEY, "loop")


@pytest.mark.slow
# torch itself uses what it deprecates
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.usefixtures("cache")
def test_a_stored_loop_is_read_and_not_traced_again() -> None:
    one, two = torch.arange(5.0), torch.ones(5)
    first = StoredLoop(_double, KEY)(one, two)
    again = StoredLoop(_untraceable, KEY)
    for count in (5, 7):
        one, two = torch.arange(float(count)), torch.ones(count)
        assert torch.equal(again(one, two)[0], 2 * one + 1)
    assert torch.equal(first[0], 2 * torch.arange(5.0) + 1)
