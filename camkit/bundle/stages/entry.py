"""The base class of every stage of a bundle: the planes that it takes and gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

from pydantic import Field

from camkit.bundle.entry import Entry, Since, Word
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.optics import Optics
from camkit.bundle.plane import Domain, Plane
from camkit.bundle.sensor import Sensor

BOUNDED: Final = Since((2, 8), "the light that a stage makes is bounded")
PORTABLE: Final = Since(
    (2, 12), "a stage follows a rule that other readers can follow in every bit"
)


class JoinError(ValueError):
    """A stage cannot take what it is given; the text says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The parts of a bundle from which stages derive their planes.

    Attributes:
        sensor: Of the camera.
        optics: None for a camera without any.
        networks: Role -> size -> facts.
    """

    sensor: Sensor
    optics: Optics | None
    networks: Mapping[str, Mapping[str, NetworkFacts]]

    def need_optics(self, why: str) -> Optics:
        """Return the optics.

        Raises:
            JoinError: If there are none.
        """
        if self.optics is None:
            raise JoinError(f"{why}, and the bundle states no optics")
        return self.optics


class StageEntry(Entry):
    """A stage as the manifest lists it.

    Attributes:
        stands_in: Which of the planes taken stands for what it gives where the stage is left out.
        runtime: Dotted name of the module that does it, see `camkit.runtime.stage_finder`; empty
            for the one of its type in `camkit.runtime.stages`.
        takes: Names of the planes it reads.
        gives: Names of the planes it makes; each has its entry among the manifest's planes.
        type: Its name in manifests; a `Literal` of each stage.
    """

    stands_in: ClassVar[int] = 0
    runtime: ClassVar[str] = ""
    takes: tuple[Word, ...]
    gives: tuple[Word, ...]
    type: Word

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the planes that the stage makes of those it takes; one for each name in `gives`.

        Raises:
            JoinError: If it cannot take them.
        """
        raise NotImplementedError


class PackageStage(StageEntry):
    """A stage that a package of its own brings, by an entry point in the group `camkit.stages`.

    Attributes:
        package: Name of the distribution that brings it, for readers that do not have it; a
            `Literal` of each stage.
    """

    since: ClassVar[Since | None] = Since((2, 9), "it lists a stage of a package of its own")
    package: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]


def need_count(planes: Sequence[Plane], least: int, most: int | None = None) -> None:
    """Refuse a number of planes; `most` is `least` unless given.

    Raises:
        JoinError: If there are too few or too many.
    """
    most = least if most is None else most
    if not least <= len(planes) <= most:
        expected = f"{least}" if least == most else f"{least} to {most}"
        raise JoinError(f"it takes {expected} plane(s), not {len(planes)}")


def need_domain(plane: Plane, domain: Domain) -> None:
    """Refuse a plane of another domain.

    Raises:
        JoinError: If the plane is of another.
    """
    if plane.domain != domain:
        raise JoinError(f"it takes planes that are {domain}, not {plane.domain}")


def need_rows(plane: Plane) -> None:
    """Refuse a plane that is no picture.

    Raises:
        JoinError: If it has more axes than rows and columns.
    """
    if plane.axes != "y x":
        raise JoinError(f"it takes pictures (y x), not planes over {plane.axes}")


def need_counts_of_pixels(planes: Sequence[Plane]) -> Plane:
    """Return the one plane of photons that a stage takes, as the pixels of the array counted them.

    Raises:
        JoinError: If it is given none, several, one of another domain or a finer one.
    """
    need_count(planes, 1)
    need_domain(planes[0], "counts")
    if planes[0].grid.pitch_ratio != 1:
        raise JoinError("it takes what the pixels of the array counted, not a finer plane")
    return planes[0]


def one_linear(planes: Sequence[Plane]) -> Plane:
    """Return the one linear plane that a stage takes.

    Raises:
        JoinError: If it is given none, several or one of another domain.
    """
    need_count(planes, 1)
    need_domain(planes[0], "linear")
    return planes[0]


def need_masks(masks: Sequence[Plane], plane: Plane, use: str) -> None:
    """Refuse masks that are none, or lie elsewhere than a plane; `use` ends the sentence.

    Raises:
        JoinError: If one is not on the samples of the plane.
    """
    for mask in masks:
        need_domain(mask, "mask")
        if mask.grid != plane.grid:
            raise JoinError(f"its mask must lie on the samples that it {use}")


def need_colours(plane: Plane, parts: Parts) -> None:
    """Refuse a plane that has not one channel for each of the sensor.

    Raises:
        JoinError: If it has others.
    """
    if plane.channels != parts.sensor.channels:
        raise JoinError(
            f"it takes one plane for each of {', '.join(parts.sensor.channels)}, not "
            f"{', '.join(plane.channels)}"
        )
