import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import camkit
from camkit.runtime.cancel import (
    Cancelled,
    cancellable,
    check_cancelled,
    current_wish,
    is_cancelled,
    watched,
)


def test_a_wish_is_a_call_or_a_flag() -> None:
    flag = threading.Event()
    assert not is_cancelled(None)
    assert not is_cancelled(flag)
    assert is_cancelled(lambda: True)
    flag.set()
    with pytest.raises(Cancelled):
        check_cancelled(flag)


@pytest.mark.parametrize(
    "call",
    [
        lambda path, **cancel: camkit.load(None).process(path, **cancel),
        lambda path, **cancel: camkit.load(None).stream(path, print, **cancel),
        lambda path, **cancel: camkit.load(None).plan(path, **cancel),
        lambda path, **cancel: camkit.load(None).start(path, **cancel),
        lambda path, **cancel: camkit.process(path, bundle="none", **cancel),
        lambda path, **cancel: camkit.WorkerPool.submit(object(), path, path, **cancel),
    ],
)
def test_what_cannot_be_asked_is_refused_by_every_call(
    tmp_path: Path, call: Callable[..., object]
) -> None:
    """The start of an array, as `process_array` begins, included; no file is needed."""
    for wish in (True, False, "stop", 3):
        with pytest.raises(camkit.ContractError, match=f"^cancel must be a function.*got {wish!r}"):
            call(tmp_path / "a.dng", cancel=wish)


def test_what_runs_long_is_stopped_soon_after_the_wish() -> None:
    flag, stopped = threading.Event(), threading.Event()
    threading.Timer(0.05, flag.set).start()
    began = time.monotonic()

    def run() -> None:
        with watched(flag, stopped.set):
            assert stopped.wait(10)
            raise OSError("what the stop made of it")

    with pytest.raises(Cancelled):
        run()
    assert time.monotonic() - began < 5


def test_an_error_without_a_wish_stays_what_it_is() -> None:
    with pytest.raises(OSError, match="own"), watched(lambda: False, lambda: None):
        raise OSError("own")
    with watched(None, lambda: None):
        assert threading.active_count() >= 1


def test_a_wish_is_known_below_and_forgotten_behind() -> None:
    wish = threading.Event()
    with cancellable(wish):
        assert current_wish() is wish
        with cancellable(None):
            assert current_wish() is None
        assert current_wish() is wish
    assert current_wish() is None
