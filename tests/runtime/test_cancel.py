import threading
import time

import pytest

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
