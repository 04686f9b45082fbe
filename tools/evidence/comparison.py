"""Two records compared: what is equal, what changed, and the ratio of their seconds."""

import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

MISSING: Final = "(missing)"
VALUE_WIDTH: Final = 60
"""Characters of a value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Differences between two records.

    Attributes:
        equal: How many entries are equal.
        changed: Entry -> its values that differ, a line each.
        ratios: Seconds after over before, of every entry that was timed in both.
    """

    equal: int
    changed: dict[str, list[str]]
    ratios: list[float]

    def lines(self) -> Iterator[str]:
        """Yield the comparison for people."""
        for name, values in self.changed.items():
            yield name
            yield from (f"    {value}" for value in values)
        yield f"{self.equal} entries equal, {len(self.changed)} changed"
        if len(self.ratios) > 1:
            low, middle, high = statistics.quantiles(self.ratios, n=4)
            yield (
                f"seconds after / before: median {middle:.3f} over {len(self.ratios)} entries, "
                f"half of them {low:.3f} to {high:.3f}; `seconds` measures two checkouts in turn"
            )


def compare(before: dict[str, Any], after: dict[str, Any]) -> Comparison:
    """Return what differs between two records."""
    old, new = before["entries"], after["entries"]
    changed = {}
    for name in sorted(old.keys() | new.keys()):
        if lines := list(_differences("", old.get(name, MISSING), new.get(name, MISSING))):
            changed[name] = lines
    timed = [
        (old[name]["seconds"], new[name]["seconds"])
        for name in old.keys() & new.keys()
        if old[name]["seconds"] and new[name]["seconds"]
    ]
    return Comparison(
        equal=len(old.keys() | new.keys()) - len(changed),
        changed=changed,
        ratios=[new_s / old_s for old_s, new_s in timed],
    )


def _differences(path: str, old: Any, new: Any) -> Iterator[str]:
    """Yield a line for every value that differs, seconds left out."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted((old.keys() | new.keys()) - {"seconds"}):
            yield from _differences(f"{path}.{key}", old.get(key, MISSING), new.get(key, MISSING))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for place, pair in enumerate(zip(old, new, strict=True)):
            yield from _differences(f"{path}[{place}]", *pair)
    elif old != new:
        yield f"{path.lstrip('.') or 'entry'}: {str(old)[:VALUE_WIDTH]} -> {str(new)[:VALUE_WIDTH]}"
