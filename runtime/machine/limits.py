"""The most that a bundle may ask of a machine, and the variables that raise these limits.

A limit is a number in the environment; without it the default here. It is read when it is needed,
so a program may set it for itself. Memory while a picture is made is capped by `max_mem_bytes`.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from camkit.errors import BundleError, ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One limit.

    Attributes:
        variable: Its name in the environment.
        default: What holds without it.
        unit: What is counted.
    """

    variable: str
    default: float
    unit: str

    def value(self, environment: Mapping[str, str] | None = None) -> float:
        """Return the limit in force.

        Args:
            environment: That of the process unless given.

        Raises:
            ContractError: If the variable holds no number above 0.
        """
        text = (os.environ if environment is None else environment).get(self.variable)
        if text is None or not text.strip():
            return self.default
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not number > 0:
            raise ContractError(
                f"{self.variable} must be a number > 0 ({self.unit}); got {text!r}: correct or "
                "unset it"
            )
        return number

    def check(self, amount: float, what: str) -> None:
        """Refuse a bundle that asks for more.

        Args:
            amount: What it asks for.
            what: Names the part of the bundle, for the message.

        Raises:
            BundleError: If it asks for more than the limit.
        """
        most = self.value()
        if not amount <= most:
            raise BundleError(
                f"{what} takes {amount:.4g} {self.unit}; at most {most:.4g} are admitted. "
                f"If you trust the bundle, set {self.variable}={_rounded_up(amount)}"
            )


def _rounded_up(amount: float) -> str:
    """Return a number of two digits that is not below."""
    if not math.isfinite(amount) or amount <= 0:
        return "inf"
    step = 10.0 ** (math.floor(math.log10(amount)) - 1)
    return f"{math.ceil(amount / step) * step:.6g}"


NETWORK_WORK: Final = Limit(
    variable="CAMKIT_MAX_NETWORK_WORK",
    default=4e6,
    unit="operations per pixel",
)
"""Multiply-adds (what is pooled or grouped counts several times), samples read and written; the
largest built-in network takes 35 000, the largest reference network 1.2 million."""

BANK_WORK: Final = Limit(
    variable="CAMKIT_MAX_BANK_WORK",
    default=2000.0,
    unit="transforms per pixel",
)
"""Fourier transforms of all channels, overlaps of blocks and rounds at clipped lights included; the
built-in cameras take 190 to 260."""

PROOF_MB: Final = Limit(variable="CAMKIT_MAX_PROOF_MB", default=2000.0, unit="MB")
"""Memory of the windows with which `camkit check` proves a network."""

PROOF_WORK: Final = Limit(
    variable="CAMKIT_MAX_PROOF_WORK", default=3e12, unit="operations in a proof"
)
"""The same as operations in all: about a minute on two cores."""
