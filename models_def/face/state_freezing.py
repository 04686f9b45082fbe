"""Several configurations of a lens frozen to one file: each by the search that it would have alone.

lens in each state -> freeze_optics -> LensState -> one FrozenOptics, and the facts of all
"""

from collections.abc import Callable, Mapping, Sequence

from camkit.bundle.frozen_optics import optics_of_states
from camkit.bundle.states.lens_state import LensState
from camkit.errors import ContractError
from camkit.models_def.optics.freeze import Facts
from camkit.models_def.optics.freezer import FreezeRequest, Freezing, freeze_optics
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.paraxial import paraxial_data


def freeze_states(
    sources: Sequence[LensOptics], request_of: Callable[[LensOptics], FreezeRequest]
) -> Freezing:
    """Freeze a lens in several configurations.

    Args:
        sources: The lens in each; the first is the usual one.
        request_of: How one of them is frozen.

    Returns:
        All in one. Its facts are the largest block grid of any, and those of each as NAME.FACT.

    Raises:
        ContractError: If one cannot be frozen; its name is in the message.
    """
    states, by_name = [], dict[str, Facts]()
    for source in sources:
        lens, name = source.lens, source.lens.state
        try:
            freezing = freeze_optics(source, request_of(source))
            data = paraxial_data(lens)
            state = LensState(
                name=name,
                psf=freezing.optics.psf,
                efl_mm=data.efl_mm,
                f_number=abs(data.f_number),
                object_distance_mm=lens.object_distance_mm,
            )
        except ContractError as error:
            raise ContractError(f"configuration {name}: {error}") from error
        states.append(state)
        by_name[name] = freezing.facts
    return Freezing(optics=optics_of_states(tuple(states)), facts=_joined(by_name))


def _joined(by_name: Mapping[str, Facts]) -> Facts:
    """Return the facts of all states, and the blocks that suit the widest kernels among them."""
    state_facts = {
        f"{name}.{fact}": value
        for name, facts in by_name.items()
        for fact, value in facts.items()
        if fact != "configuration"
    }
    blocks = ((int(facts["overlap_px"]), int(facts["block_px"])) for facts in by_name.values())
    overlap_px, block_px = max(blocks)
    return {
        "configurations": ", ".join(by_name),
        "block_px": block_px,
        "overlap_px": overlap_px,
        **state_facts,
    }
