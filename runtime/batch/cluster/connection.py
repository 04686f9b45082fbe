"""A client of dask.distributed: from the address of a scheduler, or with workers of its own."""

import asyncio
import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Final, TypeVar

from camkit.errors import CamkitError, ContractError, UnsupportedError
from camkit.runtime.network.engine import available_threads

if TYPE_CHECKING:
    from distributed import Client, LocalCluster
    from distributed.security import Security

CONNECT_S: Final = 5.0
ANSWER_S: Final = 7.0
"""A scheduler that has not answered by then is none."""

START_S: Final = 10.0

T = TypeVar("T")
logger = logging.getLogger(__name__)


class NoAnswer(CamkitError):  # noqa: N818 - says what it is
    """No answer came in time."""


def answer_within(seconds: float, ask: Callable[[], T]) -> T:
    """Return the result of a call; a call that takes longer is abandoned.

    Raises:
        NoAnswer: If it does.
    """
    answers: list[T] = []
    trouble: list[BaseException] = []

    def run() -> None:
        try:
            answers.append(ask())
        except BaseException as error:  # noqa: BLE001 - raised again by who waits
            trouble.append(error)

    thread = threading.Thread(target=run, name="camkit-ask", daemon=True)
    thread.start()
    thread.join(seconds)
    if trouble:
        raise trouble[0]
    if not answers:
        raise NoAnswer(f"no answer within {seconds:.0f} s")
    return answers[0]


@contextmanager
def connected(address: str) -> Iterator["Client"]:
    """Yield a client of a running scheduler; it is closed at the end.

    Certificates and keys of tls:// are those of dask's own configuration.

    Args:
        address: Such as tcp://HOST:8786.

    Raises:
        ContractError: If no scheduler answers there.
        UnsupportedError: If dask.distributed is not installed.
    """
    client = open_client(address)
    try:
        yield client
    finally:
        close_client(client)


@contextmanager
def own_workers(count: int) -> Iterator["Client"]:
    """Yield a client of `count` worker processes on this machine, which end with the block.

    Raises:
        UnsupportedError: If dask.distributed is not installed.
    """
    if count < 1:
        raise ContractError(f"workers must be >= 1; got {count}")
    _need_distributed()
    from distributed import Client

    cluster = _local_cluster(count)
    try:
        client = Client(cluster, set_as_default=False)
        try:
            yield client
        finally:
            close_client(client)
    finally:
        cluster.close()


def _local_cluster(count: int) -> "LocalCluster":
    """Start a scheduler and workers; an interrupt waits until they can be stopped again.

    A Ctrl-C reaches every process of the terminal. It is for this one alone, so it is blocked in
    the thread that starts the others: threads and processes inherit that.
    """
    from distributed import LocalCluster

    started: list[LocalCluster] = []
    trouble: list[Exception] = []

    def start() -> None:
        resource_tracker.ensure_running()  # later it would lift the block again
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=max(1, available_threads(None) // count),
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        except Exception as error:  # noqa: BLE001 - raised again by who waits
            trouble.append(error)
        else:
            started.append(cluster)

    thread = threading.Thread(target=start, name="camkit-workers", daemon=True)
    thread.start()
    try:
        thread.join()
    except BaseException:
        thread.join(START_S)
        for cluster in started:
            cluster.close()
        raise
    if trouble:
        raise UnsupportedError(f"the workers did not start: {_one_line(trouble[0])}")
    return started[0]


def open_client(address: str, security: "Security | None" = None) -> "Client":
    """Connect to a scheduler.

    Raises:
        ContractError: If none answers there.
        UnsupportedError: If dask.distributed is not installed.
    """
    _need_distributed()
    from distributed import Client
    from distributed.security import Security

    why = _trouble(address, security or Security())
    if why is not None:
        raise ContractError(f"no dask scheduler answers at {address}: {why}")
    return Client(address, timeout=ANSWER_S, security=security, set_as_default=False)


def _trouble(address: str, security: "Security") -> str | None:
    """Return why no scheduler is reached; None if one is.

    Asked before a client is made: one that finds no scheduler does not let go for many seconds.
    """
    try:
        kind = answer_within(ANSWER_S, lambda: asyncio.run(_kind(address, security)))
    except (NoAnswer, TimeoutError):
        return f"no answer within {CONNECT_S:.0f} s"
    except TypeError as error:
        hint = "; certificates are those of dask's configuration, distributed.comm.tls"
        return _one_line(error) + (hint if address.startswith("tls") else "")
    except (OSError, ValueError) as error:
        return _one_line(error)
    except Exception:  # whatever a foreign service's answer was taken for
        logger.debug("%s answered", address, exc_info=True)
        return "what answers there is something else"
    return None if kind == "Scheduler" else f"a {kind.lower()} of dask answers there"


async def _kind(address: str, security: "Security") -> str:
    """Return the kind of server at an address."""
    from distributed.comm.core import connect

    async def ask() -> str:
        comm = await connect(address, timeout=CONNECT_S, **security.get_connection_args("client"))
        try:
            await comm.write({"op": "identity", "n_workers": 0, "reply": True})
            return str((await comm.read())["type"])
        finally:
            comm.abort()

    return await asyncio.wait_for(ask(), CONNECT_S)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def close_client(client: "Client") -> None:
    """Close a client; a scheduler that is gone is not waited for."""
    try:
        answer_within(ANSWER_S, lambda: client.close(timeout=2))
    except Exception:
        logger.debug("a client did not close", exc_info=True)


def _need_distributed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise UnsupportedError(
            "a batch on many machines needs dask.distributed; pip install 'camkit[batch]'"
        ) from None
