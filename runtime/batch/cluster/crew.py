"""The workers of a run: looked at before they are given work, named if they do not fit."""

import pkgutil
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Final

from camkit.runtime.batch.cluster import remote
from camkit.runtime.batch.cluster.connection import NoAnswer, answer_within

if TYPE_CHECKING:
    from distributed import Client

LOOK_S: Final = 1.0
"""So often workers and places of files are looked at, but for a small share of the time."""
LOOK_SHARE: Final = 0.05
REPLY_S: Final = 8.0
TRAVEL_S: Final = 120.0
"""A bundle has as long to reach every worker that lacks it."""
SILENT_S: Final = 60.0
"""After so long a worker that did not answer is asked again."""
ASKED_AT_ONCE: Final = 32


class Crew:
    """The workers that serve a run.

    Attributes:
        slots: Address -> files that it makes at once, of workers that fit.
        unfit: Address -> why it does not.
        has_losses: Whether a worker that served the run has gone.
    """

    def __init__(
        self,
        needs: remote.Needs,
        bundles: Mapping[str, Callable[[], bytes]],
        notice: Callable[[str], None],
    ) -> None:
        """Store the needs of workers.

        Args:
            needs: Of the run.
            bundles: SHA-256 -> gives the bytes.
            notice: Called with a line for every worker that does not fit.
        """
        self.slots: dict[str, int] = {}
        self.unfit: dict[str, str] = {}
        self.has_losses = False
        self._folders: dict[str, str] = {}
        self._needs = needs
        self._bundles = bundles
        self._notice = notice
        self._looked_s = float("-inf")
        self._took_s = 0.0
        self._silent_s: dict[str, float] = {}
        self._notices: set[tuple[str, str]] = set()

    @property
    def flag(self) -> str:
        """Name the resource of workers that fit."""
        return self._needs.flag

    def forget(self) -> None:
        """Forget every worker: the scheduler is another one."""
        self.slots.clear()
        self.has_losses = True
        self._looked_s = float("-inf")

    def room(self) -> int:
        """Return the number of files that may be under way, one waiting for each worker."""
        return sum(self.slots.values()) + len(self.slots)

    def look(self, client: "Client", *, now: bool = False) -> bool:
        """Add workers that are new and drop those that are gone, once in a while.

        Args:
            client: A connected one.
            now: Also where it is early for that.

        Returns:
            Whether it looked.

        Raises:
            NoAnswer: If the scheduler does not answer.
            OSError: If it is lost.
        """
        began = time.monotonic()
        if not now and began - self._looked_s < max(LOOK_S, self._took_s / LOOK_SHARE):
            return False
        workers = answer_within(REPLY_S, lambda: _workers(client))
        if not now:
            self._looked_s = time.monotonic()
            self._took_s = self._looked_s - began
        # a worker that is started again may have its address again, its folder is another one
        folders = {
            address: str(worker.get("local_directory")) for address, worker in workers.items()
        }
        for missing in [
            a for a in {**self.slots, **self.unfit} if folders.get(a) != self._folders[a]
        ]:
            if self.slots.pop(missing, None) is not None:
                self.has_losses = True
                self._notice(f"worker {missing} is lost; its files are made again")
            self.unfit.pop(missing, None)
        for silent in [a for a, start_s in self._silent_s.items() if began - start_s > SILENT_S]:
            del self._silent_s[silent]
            self.unfit.pop(silent, None)
        self._folders = folders
        if new := [address for address in folders if address not in {**self.slots, **self.unfit}]:
            self._take_in(client, new)
        return True

    def tasks_by_worker(self, client: "Client") -> dict[str, frozenset[str]]:
        """Return the tasks that every worker has got, by its address.

        Raises:
            NoAnswer: If the scheduler does not answer.
            OSError: If it is lost.
        """
        began = time.monotonic()
        tasks = answer_within(REPLY_S, client.processing)
        self._took_s += time.monotonic() - began
        return {address: frozenset(map(str, keys)) for address, keys in tasks.items()}

    def _take_in(self, client: "Client", new: Sequence[str]) -> None:
        """Query new workers in turn; each question goes to those that are left."""
        from camkit import __version__

        # asked with what every worker has: it may hold no camkit to ask with; the metadata of an
        # editable install may be those of an earlier version
        workers = self._answers(client, new, pkgutil.resolve_name, "camkit:__version__")
        workers = self._keep(
            workers, lambda got: got == __version__, f"has camkit {{}}, not {__version__}"
        )
        here = platform.machine()
        workers = self._answers(client, workers, platform.machine)
        workers = self._keep(
            workers, lambda got: got == here, f"is {{}}, this machine {here}: other bits"
        )
        looked = self._answers(client, workers, remote.look, self._needs)
        workers = {address: lacks for address, (reason, lacks) in looked.items() if reason is None}
        for address, (reason, _) in looked.items():
            if reason is not None:
                self._leave_out(address, reason)
        for sha256, read in self._bundles.items():
            lacking = [address for address, lacks in workers.items() if sha256 in lacks]
            got = self._answers(client, lacking, remote.take_bundle, sha256, read, seconds=TRAVEL_S)
            for address in set(lacking) - set(got):
                del workers[address]
        self.slots |= self._answers(client, workers, remote.offer, self._needs)

    def _answers(
        self,
        client: "Client",
        workers: Sequence[str] | Mapping[str, Any],
        function: Callable[..., Any],
        *args: Any,
        seconds: float = REPLY_S,
    ) -> dict[str, Any]:
        """Run a function on workers; return its results, without those of workers that failed."""
        if not workers:
            return {}
        ready = [arg() if callable(arg) else arg for arg in args]

        def ask(addresses: list[str]) -> dict[str, Any]:
            try:
                return answer_within(
                    seconds,
                    lambda: client.run(function, *ready, workers=addresses, on_error="return"),
                )
            except NoAnswer:
                return {}

        addresses = list(workers)
        answers = ask(addresses)
        if not answers and len(addresses) > 1:  # one that is silent keeps the answers of all
            with ThreadPoolExecutor(ASKED_AT_ONCE) as pool:
                for answer in pool.map(lambda address: ask([address]), addresses):
                    answers |= answer
        results = {}
        for address in addresses:
            if address not in answers:
                self._silent_s[address] = time.monotonic()
                self._leave_out(address, f"does not answer within {seconds:.0f} s")
            elif isinstance(answers[address], BaseException):
                self._leave_out(address, _trouble(answers[address]))
            else:
                results[address] = answers[address]
        return results

    def _keep(
        self, answers: Mapping[str, Any], fits: Callable[[Any], bool], reason: str
    ) -> dict[str, Any]:
        for address, answer in answers.items():
            if not fits(answer):
                self._leave_out(address, reason.format(answer))
        return {address: answer for address, answer in answers.items() if fits(answer)}

    def _leave_out(self, address: str, reason: str) -> None:
        self.unfit[address] = reason
        if (address, reason) not in self._notices:
            self._notices.add((address, reason))
            self._notice(f"worker {address} is left out: {reason}")

    def dismiss(self, client: "Client") -> None:
        """End the run on all workers."""
        workers = list(self.slots)
        answer_within(
            REPLY_S,
            lambda: client.run(remote.forget, self._needs.run, workers=workers, on_error="ignore"),
        )

    def busy(self, client: "Client") -> int:
        """Return the number of files of the run that are in the making."""
        workers = list(self.slots)
        answers = answer_within(
            REPLY_S,
            lambda: client.run(remote.busy, self._needs.run, workers=workers, on_error="ignore"),
        )
        return sum(answers.values())


def _workers(client: "Client") -> dict[str, dict[str, Any]]:
    """Return the scheduler's facts about every worker, by its address.

    Asked of it directly: `client.scheduler_info` answers for five workers if the client has looked
    after itself meanwhile.
    """
    scheduler: Any = client.scheduler
    workers: dict[str, dict[str, Any]] = client.sync(scheduler.identity, n_workers=-1)["workers"]
    return workers


def _trouble(error: BaseException) -> str:
    """Return the answer of a worker in words."""
    if isinstance(error, ModuleNotFoundError):
        return f"lacks {error.name}"
    return " ".join(str(error).split()) or type(error).__name__
