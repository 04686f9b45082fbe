"""Networks that are bounded: as the bundle states it, else by the usual bound.

    manifest, laws -> stages, networks behind a bank with a bound

Bundles of formats before 2.8 could state no bound and keep their bits unless the caller enforces
the laws; from 2.8 on a network behind a bank is bounded whether its bundle says so or not.
"""

from collections.abc import Sequence
from typing import Final

from camkit.bundle.light_bound import USUAL_BOUND
from camkit.bundle.manifest import LIGHT_VERSION, Manifest
from camkit.bundle.stages import Network, Stage, Wiener
from camkit.runtime.options import Laws

ENFORCE: Final[Laws] = "enforce"


def bounded_stages(manifest: Manifest, laws: Laws) -> tuple[Stage, ...]:
    """Return the stages that are walked.

    Args:
        manifest: Of the bundle.
        laws: What the caller chose.
    """
    if laws != ENFORCE and manifest.version_pair < LIGHT_VERSION:
        return manifest.stages
    return tuple(_bounded(stage, manifest) for stage in manifest.stages)


def front_end(network: Network, stages: Sequence[Stage]) -> Wiener | None:
    """Return the bank whose picture a network improves on; None if it improves on another."""
    banks = [stage for stage in stages if isinstance(stage, Wiener)]
    return next((bank for bank in banks if set(bank.gives) & set(network.takes)), None)


def broken_laws(manifest: Manifest, sizes: Sequence[str]) -> tuple[str, ...]:
    """Return the laws of a picture that a bundle states as broken by one of some sizes."""
    laws_by_size = manifest.laws or {}
    names = (
        name.replace("_", " ")
        for size in sizes
        for name, law in laws_by_size.get(size, {}).items()
        if not law.kept
    )
    return tuple(dict.fromkeys(names))


def _bounded(stage: Stage, manifest: Manifest) -> Stage:
    if not isinstance(stage, Network) or stage.light is not None:
        return stage
    bank = front_end(stage, manifest.stages)
    if bank is None or not _stands_for(stage, manifest):
        return stage
    planes = manifest.all_planes
    masks = tuple(name for name in bank.takes if planes[name].domain == "mask")
    return stage.model_copy(update={"takes": stage.takes + masks, "light": USUAL_BOUND})


def _stands_for(network: Network, manifest: Manifest) -> bool:
    """Return whether the last plane of a network is of the kind that it gives."""
    planes = manifest.all_planes
    outputs = [planes[name] for name in network.gives]
    last = planes[network.takes[-1]]
    return network.transform == "stabilise" and len(outputs) == 1 and last.stands_for(outputs[0])
