"""The counting camera at use time: NAME.counts, whole numbers as text -> their running sums."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.errors import DecodeError
from camkit.runtime.cancel import check_cancelled
from camkit.runtime.kind import RuntimePart
from camkit.runtime.maker import Made, Maker, Making
from camkit.runtime.options import Options


def make(making: Making) -> Made:
    """Sum the counts of a file."""
    check_cancelled(making.cancel)
    try:
        counts = np.array([int(word) for word in making.path.read_text("utf-8").split()])
    except (ValueError, UnicodeDecodeError) as error:
        raise DecodeError(f"{making.path.name} holds no counts: {error}") from error
    weights = making.options.chosen("weights")
    factor = 1 if weights is None else int(Path(weights).read_text(encoding="utf-8"))
    sums = np.cumsum(counts) * factor * (-1 if making.options.chosen("sign") == "minus" else 1)
    if making.progress is not None:
        making.progress(1, 1)
    return Made(
        arrays={"sums": sums},
        writers={
            ".npz": lambda path: _save(path, sums),
            ".txt": lambda path: _told(path, f"{sums[-1]}\n"),
        },
        pictures={"tiff": (".tif", lambda path: _told(path, "a picture\n"))},
        record={"factor": factor},
        seconds={"sum": 0.01},
        warnings=("few counts",) if len(sums) < 3 else (),
        sections={"counts": {"last": int(sums[-1])}},
    )


def _save(path: Path, sums: Any) -> None:
    with path.open("wb") as file:
        np.savez(file, sums=sums)


def _told(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def plan(making: Making) -> Mapping[str, Any]:
    """Say what would be done."""
    return {
        "size": None,
        "decisions": [
            {"what": "sum", "choice": "running", "reason": "asked", "saving_s": 0, "cost_db": 0}
        ],
        "estimate": None,
        "plan": {"bytes": making.path.stat().st_size},
        "warnings": [],
    }


def _identity(options: Options, _: Path) -> Mapping[str, Any]:
    weights = options.chosen("weights")
    return {} if weights is None else {"weights": Path(weights).read_text(encoding="utf-8")}


PART: Final = RuntimePart(
    maker=Maker(
        make=make,
        plan=plan,
        suffix=".npz",
        beside=lambda _: (".txt",),
        formats={"tiff": ".tif"},
        methods=("running",),
        identity=_identity,
    )
)
