"""The finder of the module that does the work of a stage.

It is the one that the stage names as its `runtime`, else that of its type in
`camkit.runtime.stages`.

A module defines

    prepare(entry, job) -> StageWork     what the stage does to one capture; cheap, before any row
    METHODS                              names of its ways, as `--method` takes them; one that
                                         restores has at least one, or its result counts as
                                         developed alone
    OPTIONS                              fields of `Options` that mean something to it
    seconds(entry, subject, work, speed)    optional: what it will take; a plan counts 0 without
    look(entry, job) -> Job              optional: looks at the capture before anything is planned;
                                         the job returned knows what it found
    IS_NEEDED                            optional: true where no method leaves the stage out
    ON_MOSAIC                            optional: true where it needs the mosaic itself, so that
                                         none of its samples are averaged (`--scale`)
    is_left_out(options)                 optional: whether the caller wants it left out
    check(entry, manifest, max_bytes)    optional: refuses, when a bundle is loaded, what asks too
                                         much of a machine
    FACTS                                optional: facts of a camera body that it knows, by name
    tuning(entry, method)                optional: how one of its ways was tuned (`plan.tuning`)
"""

import importlib
from collections.abc import Sequence
from functools import cache
from types import ModuleType
from typing import Final

from camkit.bundle.manifest import Manifest
from camkit.bundle.stages import StageEntry, all_stages, find_stage, type_of
from camkit.bundle.stages.register import READY, stages_of_packages
from camkit.entry_points import has_module, load_part
from camkit.errors import ContractError, UnsupportedError

REQUIRED_PARTS: Final = ("prepare", "METHODS", "OPTIONS")
STAGES: Final = "camkit.runtime.stages"
"""Named, not imported: its modules import what imports this one."""


@cache
def stage_module(name: str) -> ModuleType:
    """Return the module of a stage.

    Raises:
        UnsupportedError: If there is no such stage, or this runtime does not do it.
        ContractError: If a package brings what is none, or its module fails or lacks a part.
    """
    return _module(find_stage(name))


def module_of(stage: StageEntry) -> ModuleType:
    """Return the module of a listed stage, which need not be one that a bundle may list."""
    return _module(type(stage))


@cache
def _module(entry: type[StageEntry]) -> ModuleType:
    name, stage = _module_name(entry), f"the stage {type_of(entry)!r}"
    if not has_module(name):
        raise UnsupportedError(f"{stage} is not walked: there is no module {name}")
    module = load_part(name, stage) if entry.runtime else importlib.import_module(name)
    if missing := [part for part in REQUIRED_PARTS if not hasattr(module, part)]:
        raise ContractError(f"the module {name} of {stage} does not define {', '.join(missing)}")
    return module


def states_of_packages() -> dict[str, str]:
    """Return the stages that packages bring by name: `READY`, or why they are refused."""
    states = stages_of_packages()
    for name in [name for name, state in states.items() if state == READY]:
        try:
            stage_module(name)
        except (ContractError, UnsupportedError) as error:
            states[name] = str(error)
    return states


def _module_name(entry: type[StageEntry]) -> str:
    return entry.runtime or f"{STAGES}.{type_of(entry)}"


def check_stages(manifest: Manifest, max_bytes: int) -> None:
    """Refuse stages that ask too much of a machine.

    Args:
        manifest: Of the bundle.
        max_bytes: Memory that the process may take.

    Raises:
        BundleError: If one does more work than is admitted.
        ContractError: If one cannot do with the memory.
    """
    for stage in manifest.stages:
        check = getattr(module_of(stage), "check", None)
        if check is not None:
            check(stage, manifest, max_bytes)


def known_facts(stages: Sequence[StageEntry]) -> tuple[str, ...]:
    """Return the facts of a camera body that some stages know."""
    return tuple(
        dict.fromkeys(fact for stage in stages for fact in getattr(module_of(stage), "FACTS", ()))
    )


def stage_keys(stages: Sequence[StageEntry]) -> tuple[str, ...]:
    """Return a name of every stage for people and clocks: its type, and its role or number."""
    types: list[str] = [stage.type for stage in stages]
    roles = [(stage.type, getattr(stage, "role", None)) for stage in stages]
    keys: list[str] = []
    for number, (type_, role) in enumerate(roles):
        if types.count(type_) == 1:
            keys.append(type_)
        elif role is not None and roles.count((type_, role)) == 1:
            keys.append(f"{type_} {role}")
        else:
            keys.append(f"{type_} {types[: number + 1].count(type_)}")
    return tuple(keys)


def methods_of(stages: Sequence[StageEntry]) -> tuple[str, ...]:
    """Return the ways of the stages, as `--method` takes them; those of the last stage first."""
    return tuple(
        dict.fromkeys(method for stage in reversed(stages) for method in module_of(stage).METHODS)
    )


def all_methods() -> tuple[str, ...]:
    """Return the ways of every stage whose seconds a plan estimates, whatever a bundle lists."""
    names = sorted(type_of(entry) for entry in all_stages() if has_module(_module_name(entry)))
    modules = [module for name in names if hasattr(module := stage_module(name), "seconds")]
    return tuple(dict.fromkeys(method for module in modules for method in module.METHODS))
