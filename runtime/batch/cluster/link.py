"""The way to a scheduler, found again when it is lost."""

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from camkit.errors import CamkitError
from camkit.runtime.batch.cluster.connection import close_client, open_client

if TYPE_CHECKING:
    from distributed import Client


class Link:
    """A client, or the one that took its place.

    Attributes:
        client: To be used now.
        address: Of the scheduler.
    """

    def __init__(
        self, client: "Client", topic: str | None, hear: Callable[[tuple[float, Any]], None]
    ) -> None:
        """Store a client, which stays its owner's, and subscribe to a topic of the workers."""
        self.client = client
        self.address = str(getattr(client.scheduler, "address", ""))
        self._security = client.security
        self._topic = topic
        self._ears = [hear]  # emptied at the end: a client keeps for life what it was given
        self._is_ours = False
        self._subscribe()

    @property
    def is_up(self) -> bool:
        """Return whether the scheduler is there, as far as is known."""
        return bool(self.client.status == "running")

    def check(self) -> None:
        """Refuse a client that has given up; one that tries again by itself is let, and listens.

        Raises:
            ConnectionError: If so.
        """
        if self.client.status in {"closed", "closing"}:
            raise ConnectionError("the connection is closed")
        if self.is_up and self.client.scheduler_comm is not self._comm:
            self._subscribe()

    def find_again(self) -> bool:
        """Connect anew; return whether that worked."""
        try:
            client = open_client(self.address, self._security)
        except (CamkitError, OSError):
            return False
        self._close()
        self.client, self._is_ours = client, True
        self._subscribe()
        return True

    def end(self) -> None:
        """Restore the caller's client, or close one of our own."""
        self._ears.clear()
        if self._topic is not None:
            with contextlib.suppress(Exception):
                self.client.unsubscribe_topic(self._topic)
        self._close()

    def _close(self) -> None:
        if self._is_ours:
            close_client(self.client)

    def _subscribe(self) -> None:
        """Subscribe with the scheduler; one that was started again knows no subscribers."""
        self._comm, ears = self.client.scheduler_comm, self._ears

        def hear(event: tuple[float, Any]) -> None:
            for ear in ears:
                ear(event)

        if self._topic is not None:
            self.client.subscribe_topic(self._topic, hear)
