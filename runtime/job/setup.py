"""The setup that all captures of a pipeline share."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Color, Demosaic, Linearise, RaiseClipped, Stage, WhiteBalance
from camkit.errors import ContractError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.options import Options
from camkit.runtime.plan.bounded_networks import bounded_stages
from camkit.runtime.plan.speed import Speed

DEVELOPMENT: Final[tuple[Stage, ...]] = (
    Linearise(gives=("light",)),
    WhiteBalance(takes=("light",)),
    Demosaic(method="fast"),
    RaiseClipped(takes=("rgb",)),
    Color(takes=("neutral",)),
)
"""What is done to a capture without a bundle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """The setup that all captures of a pipeline share.

    Attributes:
        bundle: The camera; None develops only.
        options: What the caller chose.
        networks: Gives the network of a role and size.
        speed: Gives how fast this machine is with the networks of some sizes.
        threads: Threads to compute with.
    """

    bundle: Bundle | None
    options: Options
    networks: Callable[[str, str], NetworkEngine]
    speed: Callable[[Sequence[str]], Speed]
    threads: int

    @property
    def stages(self) -> tuple[Stage, ...]:
        """Return the stages that are walked."""
        if self.bundle is None:
            return DEVELOPMENT
        return bounded_stages(self.bundle.manifest, self.options.laws)

    @property
    def known_bundle(self) -> Bundle:
        """Return the bundle.

        Raises:
            ContractError: If there is none.
        """
        if self.bundle is None:
            raise ContractError("this needs a bundle, and there is none")
        return self.bundle
