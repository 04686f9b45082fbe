"""The caller's wish to stop: asked between pieces of work, and watched during long ones."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final, Protocol

from camkit.errors import CamkitError, ContractError

POLL_S: Final = 0.1


class Flag(Protocol):
    """Something that can be raised from another thread, like `threading.Event`."""

    def is_set(self) -> bool:
        """Return whether it has been raised."""
        ...


Cancel = Callable[[], bool] | Flag
"""Asked often, from several threads; true, or raised, ends the work."""


class Cancelled(CamkitError):  # noqa: N818 - a wish, not an error
    """The caller asked to stop."""


def check_cancel(cancel: object) -> None:
    """Refuse what cannot be asked whether its caller wants to stop, such as True.

    Raises:
        ContractError: If it is neither None, nor a function, nor an event.
    """
    if not (cancel is None or callable(cancel) or callable(getattr(cancel, "is_set", None))):
        raise ContractError(
            f"cancel must be a function, or an event such as threading.Event(); got {cancel!r}"
        )


def is_cancelled(cancel: Cancel | None) -> bool:
    """Return whether the caller asked to stop."""
    if cancel is None:
        return False
    return cancel() if callable(cancel) else cancel.is_set()


def check_cancelled(cancel: Cancel | None) -> None:
    """Stop the work if the caller asked to stop.

    Raises:
        Cancelled: If so.
    """
    if is_cancelled(cancel):
        raise Cancelled("stopped on request")


@contextmanager
def watched(cancel: Cancel | None, stop: Callable[[], None]) -> Iterator[None]:
    """Poll the wish while the block runs; call `stop` if the caller wants it to end.

    Args:
        cancel: The wish; without one nothing is watched.
        stop: Makes the block come to an end; called once, from another thread.

    Raises:
        Cancelled: At the end of the block if `stop` was called, whatever else it raised.
    """
    if cancel is None:
        yield
        return
    ended, stopped = threading.Event(), threading.Event()

    def watch() -> None:
        while not ended.wait(POLL_S):
            if is_cancelled(cancel):
                stopped.set()
                stop()
                return

    thread = threading.Thread(target=watch, name="camkit-cancel", daemon=True)
    thread.start()
    try:
        yield
    except Exception as error:
        if stopped.is_set():
            raise Cancelled("stopped on request") from error
        raise
    finally:
        ended.set()
        thread.join()
    if stopped.is_set():
        raise Cancelled("stopped on request")


_WISH: ContextVar[Cancel | None] = ContextVar("camkit_cancel", default=None)


@contextmanager
def cancellable(cancel: Cancel | None) -> Iterator[None]:
    """Set the wish that functions called in the block can read (see `current_wish`).

    Raises:
        ContractError: If it cannot be asked; see `check_cancel`.
    """
    check_cancel(cancel)
    token = _WISH.set(cancel)
    try:
        yield
    finally:
        _WISH.reset(token)


def check_wish() -> None:
    """Stop the work if the caller of this thread's work asked to stop; see `cancellable`.

    Raises:
        Cancelled: If so.
    """
    check_cancelled(current_wish())


def current_wish() -> Cancel | None:
    """Return the wish that this thread works under."""
    return _WISH.get()
