"""What all captures of a pipeline share."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from camkit.bundle.reader import Bundle
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.options import Options
from camkit.runtime.plan.speed import Speed


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What all captures of a pipeline share.

    Attributes:
        bundle: The camera; None develops only.
        options: What the caller chose.
        engine: The network; None for the classical methods.
        networks: Gives the network of a size.
        speed: Gives how fast this machine is with the networks of some sizes.
        threads: Threads to compute with.
    """

    bundle: Bundle | None
    options: Options
    engine: NetworkEngine | None
    networks: Callable[[str], NetworkEngine]
    speed: Callable[[Sequence[str]], Speed]
    threads: int
