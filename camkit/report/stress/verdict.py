"""Examiners of sweeps, of any kind of camera: methods, verdicts, pictures to look at."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from camkit.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One method on one capture.

    Attributes:
        psnr_db: On sRGB values; None where nothing can be compared.
        chi2: Per sample, 1 on nominal captures; None where nothing can be judged.
        fault: What is wrong whatever the PSNR: it breaks the method at this value.
        patch_px: (x, y) of the worst square of the picture.
        extra: Other numbers of the scenario, by name with unit.
    """

    psnr_db: float | None
    chi2: float | None = None
    fault: str | None = None
    patch_px: tuple[int, int] | None = None
    extra: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """All methods on one capture.

    Attributes:
        outcomes: Method -> outcome.
        seen: What the runtime sees of the capture beforehand (`camkit.runtime.envelope`).
    """

    outcomes: Mapping[str, Outcome]
    seen: Mapping[str, float] = field(default_factory=dict)


class SweptScene(Protocol):
    """Scene of a sweep; what it shows is a matter of the kind of camera."""

    @property
    def name(self) -> str:
        """Name the scene, for reports and journals."""
        ...


class Examiner(Protocol):
    """Restores captures of one bundle by every method, and says what each is worth.

    Scenarios of a kind of camera may ask more of the examiner of that kind.
    """

    @property
    def methods(self) -> tuple[str, ...]:
        """Name the methods, from doing nothing to the networks."""
        ...

    @property
    def rivals(self) -> tuple[str, ...]:
        """Name the methods that the others must not fall behind."""
        ...

    @property
    def primary(self) -> str:
        """Name the method whose break point is the scenario's."""
        ...

    @property
    def identity(self) -> tuple[object, ...]:
        """Return what decides the verdicts, as plain JSON values."""
        ...

    def score(self, shot: Any) -> Verdict:
        """Restore a capture by every method, and judge it."""
        ...

    def pictures(self, shot: Any) -> Mapping[str, FloatArray]:
        """Return "sharp" and every method -> (3, h, w) sRGB values, to look at."""
        ...
