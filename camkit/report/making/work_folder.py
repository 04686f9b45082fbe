"""The folder of a long making: every step is done once, whatever interrupts it.

steps.json      what was asked for, and of every finished step its facts and CPU-seconds
"""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.output.part_file import atomic_output
from camkit.stopwatch import Stopwatch

RECORD: Final = "steps.json"
LASTING: Final = "filtered"
"""The first step whose result somebody uses."""
Facts = dict[str, Any]


def remove_work(folder: Path) -> None:
    """Remove the folder of an earlier making, if it is there.

    Raises:
        ContractError: If it holds something else.
    """
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    if not (folder / RECORD).is_file():
        raise ContractError(
            f"{folder} holds no steps of a camera ({RECORD}), so nothing in it is replaced; name "
            f"another folder by {option_text('work_dir')}"
        )
    shutil.rmtree(folder)


class WorkFolder:
    """A folder with a record of its finished steps."""

    def __init__(self, folder: Path, words: Mapping[str, Any], stopwatch: Stopwatch) -> None:
        """Open a folder, or begin it.

        Args:
            folder: Made if it is not there.
            words: What is asked for, plain JSON values; steps of other words are not taken, and
                forgotten if nothing came of them yet (`LASTING`).
            stopwatch: Counts CPU time, that of this process's start included.

        Raises:
            ContractError: If the folder was begun with other words.
        """
        self.folder = folder
        self._watch, self._counted_s = stopwatch, 0.0
        self._path = folder / RECORD
        self._record: dict[str, Any] = {"words": dict(words), "steps": {}}
        if self._path.is_file():
            begun = json.loads(self._path.read_text(encoding="utf-8"))
            others = _others(begun["words"], words)
            if others and LASTING in begun["steps"]:
                raise ContractError(
                    f"{folder} was begun with another {', '.join(others)}: give the same, or begin "
                    f"anew with {option_text('overwrite')}"
                )
            if not others:
                self._record = begun
        folder.mkdir(parents=True, exist_ok=True)

    def step(self, name: str, work: Callable[[], Facts]) -> Facts:
        """Return the facts of a step, doing it if it is not done."""
        steps: dict[str, Facts] = self._record["steps"]
        if name not in steps:
            facts = work()
            steps[name] = {**facts, "cpu_s": round(self._lap_s(), 1)}
            self._write()
        return steps[name]

    def is_done(self, name: str) -> bool:
        """Return whether a step is done."""
        return name in self._record["steps"]

    def spent_s(self) -> float:
        """Return the CPU-seconds of all finished steps and of the one in progress."""
        finished = sum(facts["cpu_s"] for facts in self._record["steps"].values())
        return float(finished) + self._watch.cpu_s() - self._counted_s

    def seconds(self) -> dict[str, float]:
        """Return the CPU-seconds of every finished step."""
        return {name: facts["cpu_s"] for name, facts in self._record["steps"].items()}

    def path(self, name: str) -> Path:
        """Return the path of a file of the folder."""
        return self.folder / name

    def _lap_s(self) -> float:
        now_s = self._watch.cpu_s()
        lap_s, self._counted_s = now_s - self._counted_s, now_s
        return lap_s

    def _write(self) -> None:
        with atomic_output(self._path) as part:
            part.write_text(json.dumps(self._record, indent=1) + "\n", encoding="utf-8")


def _others(begun: Mapping[str, Any], words: Mapping[str, Any]) -> list[str]:
    """Return the names of words that two calls do not share."""
    plain = json.loads(json.dumps(dict(words)))
    return sorted(k for k in begun.keys() | plain.keys() if begun.get(k) != plain.get(k))
