"""The way of every stage of a capture: its own, that of the method asked for, or none.

    stages, work -> one way per stage: a name, or LEFT_OUT

A method is the name of a way of one stage. Stages before it take their usual way; stages behind it
that restore are left out. A stage may be left out only where a plane that it takes can stand for
the plane that it gives: the same samples on the same grid, in the same domain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.manifest import Manifest
from camkit.bundle.plane import Plane
from camkit.bundle.stages import Network, StageEntry
from camkit.errors import ContractError
from camkit.runtime.plan.decision import DEVELOP, Work
from camkit.runtime.stage_finder import methods_of, module_of

LEFT_OUT: Final = ""
WHOLE: Final = "whole"
"""The way of a stage that has only one."""


def ways_of(stages: Sequence[StageEntry], work: Work) -> tuple[str, ...]:
    """Return the way of every stage.

    Raises:
        ContractError: If no stage has the method.
    """
    last = len(stages) if work.method is None else _last_with(stages, work.method)
    ways: list[str] = []
    for number, stage in enumerate(stages):
        module = module_of(stage)
        methods, is_needed = module.METHODS, getattr(module, "IS_NEEDED", False)
        if stage.type in work.left_out:
            ways.append(LEFT_OUT)
        elif not methods:
            ways.append(WHOLE)
        elif number > last and not is_needed:
            ways.append(LEFT_OUT)
        else:
            ways.append(work.method if number == last and work.method else methods[0])
    return tuple(ways)


def planned(stages: Sequence[StageEntry], work: Work) -> Work:
    """Return the work with what follows from its ways.

    Raises:
        ContractError: If no stage has its method.
    """
    return replace(work, networks=runs(stages, Network, work))


def runs(stages: Sequence[StageEntry], kind: type[StageEntry], work: Work) -> bool:
    """Return whether any stage of a kind is run.

    Raises:
        ContractError: If no stage has the method.
    """
    ways = zip(stages, ways_of(stages, work), strict=True)
    return any(isinstance(stage, kind) and way != LEFT_OUT for stage, way in ways)


def without_networks(manifest: Manifest, work: Work) -> Work | None:
    """Return the work by the best method that runs no network; None if they cannot be left out."""
    stages = manifest.stages
    methods = offered_methods(stages, manifest.all_planes)
    works = (planned(stages, replace(work, method=method)) for method in methods)
    return next((other for other in works if not other.networks), None)


def offered_methods(stages: Sequence[StageEntry], planes: Mapping[str, Plane]) -> tuple[str, ...]:
    """Return the methods by which the stages can be walked, the best first.

    Args:
        stages: In order.
        planes: By name, that of the sensor among them.
    """
    return tuple(
        method
        for method in (*methods_of(stages), DEVELOP)
        if all(
            _is_possible(stage, way, method, planes)
            for stage, way in zip(stages, ways_of(stages, Work(method=method)), strict=True)
        )
    )


def _is_possible(stage: StageEntry, way: str, method: str, planes: Mapping[str, Plane]) -> bool:
    """Return whether a stage can take a way; where nothing is restored, no stage restores."""
    if way == LEFT_OUT:
        return known_stand_in(stage, planes) is not None
    return method != DEVELOP or way == WHOLE


def _last_with(stages: Sequence[StageEntry], method: str) -> int:
    """Return the number of the last stage that has a method; -1 where nothing is restored."""
    if method == DEVELOP:
        return -1
    numbers = [n for n, stage in enumerate(stages) if method in module_of(stage).METHODS]
    if numbers:
        return numbers[-1]
    if not methods_of(stages):
        return -1
    raise ContractError(
        f"method must be one of {', '.join((*methods_of(stages), DEVELOP))}; got {method!r}"
    )


def stand_ins(
    stages: Sequence[StageEntry], ways: Sequence[str], planes: Mapping[str, Plane]
) -> dict[str, str]:
    """Return the replacement of every plane that left-out stages would give.

    Args:
        stages: In order.
        ways: Of each.
        planes: By name, that of the sensor among them.

    Raises:
        ContractError: If nothing stands for it.
    """
    instead: dict[str, str] = {}
    for stage, way in zip(stages, ways, strict=True):
        if way == LEFT_OUT:
            name = stand_in(stage, planes)
            instead[stage.gives[0]] = instead.get(name, name)
    return instead


def stand_in(stage: StageEntry, planes: Mapping[str, Plane]) -> str:
    """Return the plane that replaces the output of a stage that is left out.

    Args:
        stage: Any.
        planes: By name, that of the sensor among them.

    Raises:
        ContractError: If no plane that it takes does.
    """
    name = known_stand_in(stage, planes)
    if name is not None:
        return name
    raise ContractError(
        f"the stage {stage.type} cannot be left out: none of {', '.join(stage.takes)} stands for "
        f"{', '.join(stage.gives)}"
    )


def known_stand_in(stage: StageEntry, planes: Mapping[str, Plane]) -> str | None:
    """Return the plane that replaces the output of a stage; None if there is none."""
    output = planes[stage.gives[0]]
    if len(stage.gives) == 1:
        for name in reversed(stage.takes):
            if planes[name].stands_for(output):
                return name
    return None
