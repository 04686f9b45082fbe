"""The files of a design: its checkpoint, its log and its clock."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.training.checkpoint import read_table, write_table
from camkit.stopwatch import Stopwatch


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """The options of every design.

    Attributes:
        recipe_folder: For relative paths in the recipe.
        threads: Of torch.
        resume: Go on from the checkpoint.
        overwrite: Start anew over an earlier run.
    """

    recipe_folder: Path | None = None
    threads: int = 1
    resume: bool = False
    overwrite: bool = False


class RunFiles:
    """Checkpoint, log and clock of one design; a checkpoint names the digest of its recipe."""

    def __init__(self, stem: Path, options: RunOptions, version: int, *results: Path) -> None:
        """Set the threads of torch, and the names of the files.

        Args:
            stem: Checkpoint (.pt) and log (.jsonl), without suffix.
            options: Of the run.
            version: Of the checkpoint's format.
            *results: Files that show an earlier run too.

        Raises:
            ContractError: If there is an earlier run and neither resume nor overwrite is asked
                for.
        """
        torch.set_num_threads(options.threads)
        self.checkpoint = stem.with_name(f"{stem.name}.pt")
        self.log = stem.with_name(f"{stem.name}.jsonl")
        self.resumes = options.resume and self.checkpoint.exists()
        self._version = version
        self.spent_s, self.spent_cpu_s = 0.0, 0.0
        self.start()
        earlier = [path for path in (self.checkpoint, *results) if path.exists()]
        if earlier and not (options.resume or options.overwrite):
            raise ContractError(
                f"{earlier[0]} is there already: give {option_text('resume')} to go on or "
                f"{option_text('overwrite')}"
            )

    def start(self) -> None:
        """Count time from now on, beyond what was spent before."""
        self._watch, self._earlier_s = Stopwatch(), (self.spent_s, self.spent_cpu_s)

    def stop(self) -> float:
        """Return the seconds spent so far; the clock goes on."""
        self.spent_s = self._earlier_s[0] + self._watch.wall_s()
        self.spent_cpu_s = self._earlier_s[1] + self._watch.cpu_s()
        return self.spent_s

    def record(self, digest: str, state: Mapping[str, Any], entry: Mapping[str, Any]) -> None:
        """Write a checkpoint, and append an entry to the log."""
        self.checkpoint.parent.mkdir(parents=True, exist_ok=True)
        times = {"spent_s": self.spent_s, "spent_cpu_s": self.spent_cpu_s}
        write_table(self.checkpoint, {"format": self._version, "digest": digest, **times, **state})
        clock = {"seconds": round(self.spent_s, 3), "cpu_s": round(self.spent_cpu_s, 3)}
        line = {"step": entry["step"], **clock, **entry}
        with self.log.open("a" if entry["step"] else "w", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def read(self, digest: str, *changed: str) -> dict[str, Any]:
        """Read the checkpoint, and take over the time spent.

        Args:
            digest: Of the recipe.
            *changed: Names of options that change it.

        Raises:
            ContractError: If it is none of such a design, or belongs to another recipe.
        """
        table = read_table(self.checkpoint)
        if table["format"] != self._version or "digest" not in table:
            raise ContractError(
                f"{self.checkpoint} is no checkpoint of a design of format {self._version}"
            )
        if table["digest"] != digest:
            names = ", ".join(map(option_text, changed))
            raise ContractError(
                f"{self.checkpoint} belongs to another recipe, or to other options ({names} and "
                f"the like); repeat the same ones, or give {option_text('overwrite')} or another "
                "place to write to"
            )
        self.spent_s, self.spent_cpu_s = table["spent_s"], table["spent_cpu_s"]
        return table
