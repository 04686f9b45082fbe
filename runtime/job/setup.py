"""The setup that all captures of a pipeline share."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from camkit.bundle.golden import IMAGE
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Linearise,
    RaiseClipped,
    StageEntry,
    WhiteBalance,
)
from camkit.errors import ContractError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.options import Options
from camkit.runtime.plan.bounded_networks import bounded_stages
from camkit.runtime.plan.speed import Speed

DEVELOPMENT: Final[tuple[StageEntry, ...]] = (
    Linearise(gives=("light",)),
    WhiteBalance(takes=("light",)),
    Demosaic(method="fast"),
    RaiseClipped(takes=("rgb",)),
    Color(takes=("neutral",)),
)
"""What is done to a photograph without a bundle."""
DEVELOPED: Final[Mapping[str, str]] = {IMAGE: DEVELOPMENT[-1].gives[0]}
"""Its products: name -> plane."""


def _no_proof(_: str) -> None:
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """The setup that all captures of a pipeline share.

    Attributes:
        bundle: The camera; None develops only.
        options: What the caller chose.
        networks: Gives the network of a role and size.
        speed: Gives how fast this machine is with the networks of some sizes.
        threads: Threads to compute with.
        proof: Gives what the provider has proved with the networks of a size; None for nothing.
        usual_stages: What is done to a capture without a bundle.
        usual_products: Its products then: name -> plane.
    """

    bundle: Bundle | None
    options: Options
    networks: Callable[[str, str], NetworkEngine]
    speed: Callable[[Sequence[str]], Speed]
    threads: int
    proof: Callable[[str], Mapping[str, Any] | None] = _no_proof
    usual_stages: tuple[StageEntry, ...] = DEVELOPMENT
    usual_products: Mapping[str, str] = field(default_factory=lambda: DEVELOPED)

    @property
    def products(self) -> dict[str, str]:
        """Return name -> plane of what can be made."""
        if self.bundle is None:
            return dict(self.usual_products)
        return dict(self.bundle.manifest.products)

    @property
    def stages(self) -> tuple[StageEntry, ...]:
        """Return the stages that are walked."""
        if self.bundle is None:
            return self.usual_stages
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
