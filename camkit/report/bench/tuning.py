"""Tuning of every method of a bench, as bundles and camkit record it; nothing is guessed."""

from collections.abc import Iterable, Mapping
from typing import Any

from camkit.bundle.reader import Bundle
from camkit.report.bench.trial import Trial
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.plan.tuning import Tuning, stage_tuning, stated_numbers


def tuning_table(trials: Iterable[Trial], bundles: Mapping[str, Bundle]) -> list[dict[str, Any]]:
    """Return of every method how it was tuned, once, however many rows vary it.

    Args:
        trials: All of them.
        bundles: By label.

    Returns:
        Plain JSON values: camera, bundle, method, size; and as `Tuning` has them values, source,
        captures, follows.
    """
    tunings: dict[tuple[str, str, str, str | None], Tuning] = {}
    for trial in trials:
        key = (trial.camera, trial.bundle, trial.method, trial.size)
        if key not in tunings:
            tunings[key] = tuning_of(trial, bundles[trial.bundle])
    return [_tuning_row(key, tuning) for key, tuning in tunings.items()]


def whole_tuning(camera: str, bundle: Bundle) -> list[dict[str, Any]]:
    """Return the same of all networks of a bundle, and of its other stages by their types.

    Args:
        camera: Whose captures it works on.
        bundle: One whose kind measures itself.
    """
    name, manifest = bundle.manifest.name, bundle.manifest
    rows = [
        _tuning_row((camera, name, "net", size), _of_network(size, bundle))
        for size in manifest.sizes
    ]
    for stage in manifest.stages:
        if values := stated_numbers(stage):
            role = getattr(stage, "role", None)
            source = f"stage {stage.type} of the bundle" + ("" if role is None else f", {role}")
            tuning = Tuning(values=values, source=source)
            rows.append(_tuning_row((camera, name, stage.type, None), tuning))
    return rows


def _tuning_row(key: tuple[str, str, str, str | None], tuning: Tuning) -> dict[str, Any]:
    return {
        **dict(zip(("camera", "bundle", "method", "size"), key, strict=True)),
        "values": dict(tuning.values),
        "source": tuning.source,
        "captures": tuning.captures,
        "follows": tuning.follows,
    }


def tuning_of(trial: Trial, bundle: Bundle) -> Tuning:
    """Return how the method of a trial was tuned.

    Args:
        trial: The trial.
        bundle: The one that does the work.
    """
    if trial.method == DEVELOP:
        return Tuning(source="nothing is tuned: no bank, no network", captures="none")
    if trial.size is not None:
        return _of_network(trial.size, bundle)
    tuning = stage_tuning(bundle.manifest.stages, trial.method)
    return tuning or Tuning(source="no stage of the bundle says so")


def _of_network(size: str, bundle: Bundle) -> Tuning:
    """Return what the networks of a size were trained on, in the words of the manifest."""
    manifest = bundle.manifest
    roles = [role for role, sizes in manifest.networks.items() if size in sizes]
    weights = sum(bundle.network_facts(role, size).parameters for role in roles)
    return Tuning(
        values={"parameters": weights},
        source=f"weights in {manifest.name} {manifest.version}, {', '.join(roles)}",
        captures=manifest.training_data,
    )
