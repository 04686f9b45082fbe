"""The log of a training run: one JSON object per line, and its chart."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError

_COUNTED: Final = frozenset({"step", "seconds", "cpu_s"})


class RunLog:
    """Appends entries to a file; each is on disk before the next step."""

    def __init__(self, path: Path, *, keep_until_step: int | None) -> None:
        """Open a log, a new one or one to continue.

        Args:
            path: The file.
            keep_until_step: None starts anew; else entries past that step, which a resumed run
                will make again, are dropped.
        """
        self._path = path
        entries: list[dict[str, Any]] = []
        if keep_until_step is not None and path.exists():
            entries = [e for e in read_log(path) if e["step"] <= keep_until_step]
        lines = [json.dumps(e) + "\n" for e in entries]
        path.write_text("".join(lines), encoding="utf-8")

    def write(self, entry: dict[str, Any]) -> None:
        """Append one entry."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")


def read_log(path: Path) -> list[dict[str, Any]]:
    """Read the entries of a log.

    Raises:
        ContractError: If a line is not a JSON object with a step.
    """
    entries = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            entry = json.loads(line)
        except json.JSONDecodeError as error:
            raise ContractError(f"{path}, line {number} is not JSON: {error}") from error
        if not isinstance(entry, dict) or "step" not in entry:
            raise ContractError(f"{path}, line {number} must be an object with a step")
        entries.append(entry)
    return entries


def read_parts(paths: Sequence[Path]) -> list[dict[str, Any]]:
    """Read the logs of runs that began where others ended, steps and times counted on.

    Raises:
        ContractError: If a line is not a JSON object with a step.
    """
    entries: list[dict[str, Any]] = []
    totals = dict.fromkeys(_COUNTED, 0.0)
    for path in paths:
        part = read_log(path)
        entries += [
            {**e, **{key: e[key] + totals[key] for key in _COUNTED & e.keys()}} for e in part
        ]
        for key in _COUNTED:
            totals[key] += max((e[key] for e in part if key in e), default=0)
    return entries


def plot_logs(logs: Mapping[str, Path | Sequence[Path]], chart: Path) -> None:
    """Draw loss and validation PSNR of runs over the CPU time.

    Args:
        logs: Name of the run -> its log, or those of its parts in order.
        chart: PNG to write.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    floors: set[float] = set()
    for name, path in logs.items():
        entries = read_parts([path] if isinstance(path, Path) else path)
        losses = [(e["cpu_s"] / 60, e["loss"]) for e in entries if "loss" in e]
        scores = [(e["cpu_s"] / 60, e["valid_db"]) for e in entries if "valid_db" in e]
        if losses:
            left.plot(*zip(*losses, strict=True), label=name, linewidth=0.8)
        if scores:
            right.plot(*zip(*scores, strict=True), label=name, marker=".")
        floors |= {round(max(baselines), 2) for e in entries if (baselines := _baselines(e))}
    for number, floor in enumerate(sorted(floors)):
        label = "_" if number else "without a network"
        right.axhline(floor, color="grey", linestyle=":", label=label)
    left.set(xlabel="CPU minutes", ylabel="training loss")
    right.set(xlabel="CPU minutes", ylabel="validation PSNR, sRGB (dB)")
    for axis in (left, right):
        axis.grid(alpha=0.3)
        if axis.lines:
            axis.legend()
    figure.savefig(chart, dpi=120)


def _baselines(entry: Mapping[str, Any]) -> list[float]:
    """Return the baselines in an entry, beside the network's own dB."""
    return [v for k, v in entry.items() if k.endswith("_db") and k != "valid_db"]
