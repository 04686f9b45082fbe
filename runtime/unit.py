"""One camera body: what was found of it beyond its bundle, read from a TOML file.

bundle_sha256 = "..."     the bundle that it was measured with, and is valid for
name = "body 17"          for people

[facts]                   numbers by name with unit, for stages that know them
focus_um = 12.5
"""

import difflib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.runtime.stage_finder import known_facts

_KEYS = frozenset({"bundle_sha256", "name", "facts"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One camera body.

    Attributes:
        name: For people.
        bundle_sha256: Hash of the bundle that it belongs to.
        facts: Name with unit -> number.
    """

    name: str
    bundle_sha256: str
    facts: Mapping[str, float] = field(default_factory=dict)

    def check(self, bundle: Bundle | None) -> None:
        """Refuse a unit of another bundle, or one of which facts would be passed over.

        Raises:
            ContractError: If there is no bundle, its hash is another, or no stage of it knows a
                fact; near names are suggested.
        """
        if bundle is None:
            raise ContractError(f"the unit {self.name} belongs to a bundle, and there is none")
        if bundle.sha256 != self.bundle_sha256:
            raise ContractError(
                f"the unit {self.name} was measured with the bundle of sha256 "
                f"{self.bundle_sha256[:16]}, this is {bundle.sha256[:16]}; measure it again"
            )
        known = known_facts(bundle.manifest.stages)
        if foreign := [name for name in self.facts if name not in known]:
            near = {n for name in foreign for n in difflib.get_close_matches(name, known, n=2)}
            hint = f"did you mean {' or '.join(sorted(near))}?" if near else "leave them out;"
            raise ContractError(
                f"the unit {self.name} states {', '.join(foreign)}, which no stage of bundle "
                f"{bundle.manifest.name} knows; {hint} known are: {', '.join(known) or 'none'}"
            )


def read_unit(path: Path) -> Unit:
    """Read a unit.

    Raises:
        ContractError: If the file cannot be read, or holds anything else.
    """
    try:
        table: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ContractError(f"cannot read the unit {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ContractError(f"{path} is no TOML: {error}") from error
    if unknown := table.keys() - _KEYS:
        raise ContractError(f"{path}: unknown key(s) {', '.join(sorted(unknown))}")
    digest, name = table.get("bundle_sha256"), table.get("name", path.stem)
    facts = table.get("facts", {})
    if not isinstance(digest, str) or not re.fullmatch("[0-9a-f]{64}", digest):
        raise ContractError(f"{path}: bundle_sha256 must be the hash of a bundle; got {digest!r}")
    if not isinstance(name, str) or not isinstance(facts, dict):
        raise ContractError(f"{path}: name must be text and facts a table")
    for key, value in facts.items():
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise ContractError(f"{path}: facts.{key} must be a number; got {value!r}")
    return Unit(name=name, bundle_sha256=digest, facts={key: float(v) for key, v in facts.items()})
