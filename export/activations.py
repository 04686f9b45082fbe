"""Facts of the networks of a bundle that is there, with activations of its golden cases."""

from camkit.bundle.facts import NetworkFacts
from camkit.bundle.reader import Bundle
from camkit.export.golden_cases import Cases
from camkit.runtime.network.ranges import node_activations
from camkit.runtime.proof.golden_run import case_work


def with_activations(bundle: Bundle, cases: Cases) -> dict[str, dict[str, NetworkFacts]]:
    """Return the facts with activations that hold for the golden cases too."""
    found: dict[str, dict[str, NetworkFacts]] = {}
    for role, sizes in bundle.manifest.networks.items():
        found[role] = {}
        for size, facts in sizes.items():
            windows = [
                case_work(bundle, case, arrays, size).network_input(role)[None]
                for case, arrays in cases.values()
            ]
            seen = node_activations(bundle.network_bytes(role, size), windows)
            known = facts.node_activation
            largest = {name: max(value, known.get(name, 0.0)) for name, value in seen.items()}
            top = max(facts.max_activation, *largest.values())
            found[role][size] = facts.model_copy(
                update={"node_activation": largest, "max_activation": top}
            )
    return found
