"""A Ctrl-C that Python would lose.

An interrupt that comes while Python runs the callback of a weak reference or a finaliser, as it
often does while it imports, is told to `sys.unraisablehook` and forgotten: the program goes on.
"""

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

AGAIN_S: Final = 0.02
"""Later than the callback's end, or it would be lost again."""


@contextmanager
def none_is_lost() -> Iterator[None]:
    """Raise a lost interrupt in the main thread a moment later; never after the block."""
    previous_hook, timers = sys.unraisablehook, list[threading.Timer]()

    def tell(unraisable: "UnraisableHookArgs") -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            previous_hook(unraisable)
            return
        timer = threading.Timer(AGAIN_S, _interrupt)
        timer.daemon = True
        timers.append(timer)
        timer.start()

    sys.unraisablehook = tell
    try:
        yield
    finally:
        sys.unraisablehook = previous_hook
        for timer in timers:
            timer.cancel()


def _interrupt() -> None:
    """Interrupt the main thread, also out of a wait where signals end waits."""
    if hasattr(signal, "pthread_kill") and (main := threading.main_thread().ident) is not None:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()
