"""A scenario: a knob, its values, and how one value is measured on one scene.

Scenarios are rows of tables, the modules of `scenarios/`, which nothing else has to know of. One
that photographs says how in `shoot`, and gets PSNR, chi^2 and patches for every method of the
bundle. One with another judgement brings its own `measure`. Each says in `applies` for which
bundles it is meant, by asking what a bundle states.

A kind of camera may bring scenarios of its own (`camkit.report.stress.stress_part`): they get the
examiner and the scenes of that kind.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.discovery import discover
from camkit.report.stress.verdict import Examiner, SweptScene, Verdict

End = Literal["low", "high", "both"]
Shoot = Callable[[Any, Any, float], Any]
"""(examiner, scene, value) -> a capture that the examiner scores; all three those of the kind."""
Measure = Callable[[Any, Any, float], Verdict]
Applies = Callable[[Bundle], str | None]
LEAST_ROOM_PX: Final = 160
"""What a disc on black takes with its surroundings, wherever it lies."""


def photographs(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios that photograph; None if it can."""
    manifest = bundle.manifest
    if manifest.sensor.plane.domain == "counts":
        return f"it takes {manifest.sensor.inputs[0]}, the scenario a photograph"
    if not manifest.has_kernels:
        return "it states no optics to photograph through"
    return None


def has_networks(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of networks; None if it can."""
    return photographs(bundle) if bundle.manifest.networks else "it holds no network"


def varies_over_field(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios that move its kernels; None if it can."""
    optics = bundle.manifest.optics
    if optics is not None and optics.type != "lens_profile" and optics.symmetry == "uniform":
        return "its PSF is the same over the field"
    return photographs(bundle)


def has_haze(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of what lies beside its peaks; None if it can."""
    reason = photographs(bundle)
    if reason is None and not bundle.manifest.has_haze:
        return "its optics have no haze beside their kernels"
    return reason


def has_room(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of what surrounds things; None if it can."""
    sensor = bundle.manifest.sensor
    if min(sensor.width_px, sensor.height_px) < LEAST_ROOM_PX:
        return f"its sensor has fewer than {LEAST_ROOM_PX} px along a side"
    return photographs(bundle)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A stress and its range.

    Attributes:
        name: Of the scenario, as `--scenarios` takes it.
        title: For people.
        knob: What is turned.
        unit: Of the knob; empty for a bare number.
        values: Increasing.
        nominal: The value of an undisturbed capture, one of `values`.
        quick: A subset that holds `nominal`.
        shoot: Takes the capture of one value, for the examiner to score.
        measure: Measures one value; None scores what `shoot` gives.
        labels: Names of the values, where they have no order that could be interpolated.
        log: Break points are interpolated over the logarithm.
        bounds: Quantities of the runtime's envelope that this scenario limits, and at which end.
        applies: Says why a bundle cannot take part; None if it can.
        fit: (this scenario, bundle) -> the scenario with the values of the bundle, where they
            depend on it.
        rival: Whether being below the methods without networks breaks a method here.
        rivals: The methods that others must not fall behind here; empty for those of the examiner.
        note: What a reader of the page should know.
    """

    name: str
    title: str
    knob: str
    unit: str
    values: tuple[float, ...]
    nominal: float
    quick: tuple[float, ...]
    shoot: Shoot | None = None
    measure: Measure | None = None
    labels: tuple[str, ...] = ()
    log: bool = False
    bounds: Mapping[str, End] = field(default_factory=dict)
    applies: Applies = photographs
    fit: Callable[["Scenario", Bundle], "Scenario"] | None = None
    rival: bool = True
    rivals: tuple[str, ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        values = self.values
        if list(values) != sorted(set(values)) or self.nominal not in values:
            raise ContractError(
                f"{self.name}: values must increase and hold the nominal {self.nominal}; "
                f"got {values}"
            )
        if not {self.nominal} <= set(self.quick) <= set(values):
            raise ContractError(f"{self.name}: quick must lie in values and hold the nominal")
        if self.labels and len(self.labels) != len(values):
            raise ContractError(f"{self.name}: {len(values)} values need as many labels")
        if self.shoot is None and self.measure is None:
            raise ContractError(f"{self.name}: a scenario shoots or measures")

    def for_bundle(self, bundle: Bundle) -> "Scenario":
        """Return the scenario with the values that a bundle asks for."""
        return self if self.fit is None else self.fit(self, bundle)

    def take(self, judge: Examiner, scene: SweptScene, value: float) -> Verdict:
        """Measure one value on one scene."""
        if self.measure is not None:
            return self.measure(judge, scene, value)
        assert self.shoot is not None
        return judge.score(self.shoot(judge, scene, value))

    def swept_values(self, *, quick: bool) -> tuple[float, ...]:
        """Return the values to sweep."""
        return tuple(v for v in self.values if v in self.quick) if quick else self.values


def row(name: str, title: str, knob: str, unit: str, steps: str, **facts: Any) -> Scenario:
    """Return a scenario whose values are written as text.

    Args:
        name: Of the scenario, as `--scenarios` takes it.
        title: For people.
        knob: What is turned.
        unit: Of the knob; empty for a bare number.
        steps: The values, increasing: the nominal one in brackets, those of a quick run as well
            in parentheses, such as "-2 (-1) [0] (1) 2".
        facts: Further fields of `Scenario`.
    """
    words = steps.split()
    values = {word: float(word.strip("[]()")) for word in words}
    return Scenario(
        name=name,
        title=title,
        knob=knob,
        unit=unit,
        values=tuple(values.values()),
        nominal=next(values[word] for word in words if word.startswith("[")),
        quick=tuple(values[word] for word in words if word.startswith(("[", "("))),
        **facts,
    )


SCENARIOS: Final = "camkit.report.stress.scenarios"
"""Named, not imported: its modules import this one."""


def all_scenarios() -> tuple[Scenario, ...]:
    """Return every scenario that serves all cameras, by module and row."""
    return tuple(one for table in discover(SCENARIOS, "SCENARIOS", tuple) for one in table)


def choose(names: str | None, kind_scenarios: tuple[Scenario, ...] = ()) -> tuple[Scenario, ...]:
    """Return the scenarios that a comma-separated list names; all without one.

    Args:
        names: The list.
        kind_scenarios: Scenarios of a kind of camera, beside those that serve every camera.

    Raises:
        ContractError: If one is unknown.
    """
    by_name = {scenario.name: scenario for scenario in (*all_scenarios(), *kind_scenarios)}
    if names is None:
        return tuple(by_name.values())
    requested = [name.strip() for name in names.split(",") if name.strip()]
    unknown = [name for name in requested if name not in by_name]
    if unknown or not requested:
        raise ContractError(
            f"unknown scenario(s) {', '.join(unknown) or 'none given'}; there are: "
            f"{', '.join(by_name)}"
        )
    return tuple(by_name[name] for name in requested)
