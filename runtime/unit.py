"""One camera body: the facts about it beyond its bundle, from a TOML file.

lens_sha256 = "..."       of the prescription that it was measured with, as its bundles hold it; or
bundle_sha256 = "..."     of the one bundle that it was measured with, and is valid for
name = "body 17"          for people

[facts]                   numbers by name with unit, for stages that know them
focus_um = 12.5

[measured]                optional: how well, for people; nothing follows from it
standard_error_um = 0.4
"""

import difflib
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, Final

from camkit.bundle.reader import PRESCRIPTION, Bundle
from camkit.errors import ContractError
from camkit.psf import focus_weights
from camkit.runtime.stage_finder import known_facts
from camkit.side_file import read_side_toml

FOCUS: Final = "focus_um"
"""How far the sensor lies from its nominal place, away from the lens."""
_HASHES: Final = ("bundle_sha256", "lens_sha256")
_KEYS: Final = frozenset({*_HASHES, "name", "facts", "measured"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One camera body.

    Attributes:
        name: For people.
        bundle_sha256: Hash of the bundle that it belongs to; None where its lens says that.
        lens_sha256: Hash of the lens, see `lens_hash`, whose bundles it belongs to, or None.
        facts: Name with unit -> number.
    """

    name: str
    bundle_sha256: str | None = None
    lens_sha256: str | None = None
    facts: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if (self.bundle_sha256 is None) == (self.lens_sha256 is None):
            raise ContractError(
                f"camera body {self.name} must state the hash of its bundle or that of its lens, "
                "and not both"
            )

    @property
    def focus_um(self) -> float:
        """Return the shift of its sensor from the nominal place; 0 where that is not stated."""
        return self.facts.get(FOCUS, 0.0)

    def check(self, bundle: Bundle | None) -> None:
        """Refuse a camera body of another bundle, or one with facts that no stage uses.

        Raises:
            ContractError: If there is no bundle, its hash or that of its lens is another, no stage
                of it knows a fact (near names are suggested), or its PSF does not reach the focus.
        """
        if bundle is None:
            raise ContractError(f"camera body {self.name} belongs to a bundle, and there is none")
        self._check_identity(bundle)
        names = known_facts(bundle.manifest.stages)
        if foreign := [name for name in self.facts if name not in names]:
            near = {n for name in foreign for n in difflib.get_close_matches(name, names, n=2)}
            hint = f"did you mean {' or '.join(sorted(near))}?" if near else "leave them out;"
            raise ContractError(
                f"camera body {self.name} states {', '.join(foreign)}, which no stage of bundle "
                f"{bundle.manifest.name} knows; {hint} known are: {', '.join(names) or 'none'}"
            )
        if self.focus_um:
            # a stage that knows of focus never joins without optics
            focus_weights(bundle.psf.focus_um, self.focus_um)

    def _check_identity(self, bundle: Bundle) -> None:
        if self.bundle_sha256 is not None and bundle.sha256 != self.bundle_sha256:
            raise ContractError(
                f"camera body {self.name} was measured with the bundle of sha256 "
                f"{self.bundle_sha256[:16]}, this is {bundle.sha256[:16]}; measure it again"
            )
        if self.lens_sha256 is None:
            return
        if PRESCRIPTION not in bundle.names:
            raise ContractError(
                f"camera body {self.name} is of a lens, and bundle {bundle.manifest.name} does not "
                "state which lens it has; measure it with the bundle itself"
            )
        lens_sha256 = lens_hash(bundle.member(PRESCRIPTION))
        if lens_sha256 != self.lens_sha256:
            raise ContractError(
                f"camera body {self.name} has the lens of sha256 {self.lens_sha256[:16]}, bundle "
                f"{bundle.manifest.name} that of {lens_sha256[:16]}: it is another camera's, or "
                "the lens was designed anew; measure it again"
            )


def lens_hash(prescription: bytes) -> str:
    """Return the hash by which a camera body names its lens.

    Args:
        prescription: The text that a bundle holds of its lens.
    """
    return hashlib.sha256(prescription).hexdigest()


def read_unit(path: Path) -> Unit:
    """Read a camera body.

    Raises:
        ContractError: If the file cannot be read, or holds anything else.
    """
    table = read_side_toml(path, "the camera body")
    if unknown := table.keys() - _KEYS:
        raise ContractError(f"{path}: unknown key(s) {', '.join(sorted(unknown))}")
    name, facts = table.get("name", path.stem), table.get("facts", {})
    if not isinstance(name, str) or not isinstance(facts, dict):
        raise ContractError(f"{path}: name must be text and facts a table")
    if not isinstance(table.get("measured", {}), dict):
        raise ContractError(f"{path}: measured must be a table")
    for key, value in facts.items():
        if not isinstance(value, int | float) or isinstance(value, bool) or not _is_finite(value):
            raise ContractError(f"{path}: facts.{key} must be a number; got {value!r}")
    return Unit(
        name=name, facts={key: float(v) for key, v in facts.items()}, **_identity(table, path)
    )


def _is_finite(value: float) -> bool:
    """Return whether a number is one that fits a float."""
    try:
        return isfinite(value)
    except OverflowError:
        return False


def _identity(table: Mapping[str, Any], path: Path) -> dict[str, str]:
    """Return the one hash of the bundle or the lens that a camera body belongs to."""
    hashes = {key: table[key] for key in _HASHES if key in table}
    if len(hashes) != 1:
        raise ContractError(
            f"{path}: one of {' and '.join(_HASHES)} must state where the body belongs; got "
            f"{' and '.join(hashes) or 'none'}"
        )
    for key, digest in hashes.items():
        if not isinstance(digest, str) or not re.fullmatch("[0-9a-f]{64}", digest):
            what = key.removesuffix("_sha256")
            raise ContractError(f"{path}: {key} must be the hash of a {what}; got {digest!r}")
    return hashes


def format_unit(name: str, identity: Mapping[str, str], measured: Mapping[str, float]) -> str:
    """Return the TOML text of a camera body.

    Args:
        name: For people.
        identity: `bundle_sha256` or `lens_sha256`.
        measured: Numbers by name with unit: its focus among the facts, the rest beside them.
    """
    texts = *identity.items(), ("name", name)
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in texts]
    facts = {key: value for key, value in measured.items() if key == FOCUS}
    rest = {key: value for key, value in measured.items() if key != FOCUS}
    for title, table in (("facts", facts), ("measured", rest)):
        lines += ["", f"[{title}]", *(f"{key} = {value!r}" for key, value in table.items())]
    return "\n".join(lines) + "\n"
