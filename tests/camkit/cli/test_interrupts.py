"""A Ctrl-C that Python would lose."""

import signal
import sys
import time
import weakref
from collections.abc import Iterator

import pytest

from camkit.cli.interrupts import AGAIN_S, none_is_lost


class _Gone:
    pass


def _interrupted_in_a_callback(then_s: float = 0.0) -> None:
    gone = _Gone()
    reference = weakref.ref(gone, lambda _: signal.raise_signal(signal.SIGINT))
    del gone
    assert reference() is None
    time.sleep(then_s)


@pytest.fixture
def _default_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_default_handler")
def test_an_interrupt_in_a_callback_ends_what_runs() -> None:
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), none_is_lost():
        _interrupted_in_a_callback(then_s=20.0)
    assert time.monotonic() - began < 10.0


@pytest.mark.usefixtures("_default_handler")
def test_none_comes_when_what_ran_has_ended() -> None:
    with none_is_lost():
        _interrupted_in_a_callback()
    time.sleep(5 * AGAIN_S)


@pytest.mark.usefixtures("_default_handler")
def test_python_alone_loses_it(monkeypatch: pytest.MonkeyPatch) -> None:
    lost: list[type[BaseException]] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda one: lost.append(one.exc_type))
    _interrupted_in_a_callback()
    assert lost == [KeyboardInterrupt]


def test_other_troubles_are_told_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[type[BaseException]] = []
    before = lambda one: told.append(one.exc_type)  # noqa: E731 - compared below
    monkeypatch.setattr(sys, "unraisablehook", before)
    gone = _Gone()
    with none_is_lost():
        reference = weakref.ref(gone, lambda _: 1 / 0)
        del gone
    assert (reference(), told) == (None, [ZeroDivisionError])
    assert sys.unraisablehook is before
