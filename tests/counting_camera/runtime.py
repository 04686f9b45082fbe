"""The counting camera at use time: a text of whole numbers, one stage, a running sum."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

import numpy as np

from camkit.bundle.entry import Word
from camkit.bundle.manifest import Manifest
from camkit.bundle.plane import Plane
from camkit.bundle.stages import StageEntry
from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.capture_result import Result
from camkit.runtime.job.job import Job
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.kind import RuntimePart
from camkit.runtime.kind_parts.product_files import product_outputs
from camkit.runtime.options import Options
from camkit.runtime.rows import ArrayRows, RowSource


class Weigh(StageEntry):
    """Counts, weighed."""

    runtime: ClassVar[str] = "tests.counting_camera.weigh"
    type: Literal["weigh"] = "weigh"
    takes: tuple[Word, ...] = ("capture",)
    gives: tuple[Word, ...] = ("weighed",)


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """A text of counts, (1, 1, n)."""

    counts: np.ndarray
    size: int

    height = 1
    channels = 1
    gives_own_rows = False
    resident_bytes = 0
    decoder_peak_mb = 0.0
    sha256 = None

    @property
    def width(self) -> int:
        """Give the number of counts."""
        return self.counts.shape[2]

    def plane(self, stated: Plane | None) -> Plane:
        """Give what the counts are."""
        return stated or Plane(channels=("counts",), domain="counts")

    def rows(self) -> RowSource:
        """Give the counts as one row."""
        return ArrayRows(self.counts)

    def gives(self, _plane: Plane) -> bool:
        """Give whether a plane can be a product: any can."""
        return True

    def shares_memory(self, array: np.ndarray) -> bool:
        """Give whether an array may lie where the counts do."""
        return np.may_share_memory(array, self.counts)

    def close(self) -> None:
        """Let go of the file, which was read whole."""


def read(
    file: Path, _mosaic: MosaicOptions | None, _manifest: Manifest | None, _options: Options
) -> Counts:
    """Read a file."""
    try:
        counts = np.array([int(word) for word in file.read_text("utf-8").split()])
    except (ValueError, UnicodeDecodeError) as error:
        raise DecodeError(f"{file.name} holds no counts: {error}") from error
    return Counts(counts=counts[None, None], size=file.stat().st_size)


def know(job: Job) -> Job:
    """Plan."""
    sums = {"what": "sum", "choice": "running", "reason": "asked", "saving_s": 0, "cost_db": 0}
    job.log.record |= {"bytes": job.capture.size, "decisions": [sums]}
    return replace(job, white_balance=(1.0,))


def factor_of(options: Options) -> int:
    """Give what every count is multiplied by."""
    weights = options.chosen("weights")
    return 1 if weights is None else int(Path(weights).read_text(encoding="utf-8"))


def make(work: Reconstruction) -> Result:
    """Sum the counts of a file."""
    (weighed,) = work.metered(work.stream_of("sums").bands())
    sums = np.cumsum(weighed)
    return Result(
        arrays={"sums": sums},
        writers={
            ".npz": lambda path: _save(path, sums),
            ".txt": lambda path: _told(path, f"{sums[-1]}\n"),
        },
        pictures={"tiff": (".tif", lambda path: _told(path, "a picture\n"))},
        record={"factor": factor_of(work.job.options)},
        seconds=work.seconds,
        warnings=("few counts",) if len(sums) < 3 else (),
        sections={"counts": {"last": int(sums[-1])}},
    )


def _save(path: Path, sums: Any) -> None:
    with path.open("wb") as file:
        np.savez(file, sums=sums)


def _told(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _identity(options: Options, _: Path) -> Mapping[str, Any]:
    weights = options.chosen("weights")
    return {} if weights is None else {"weights": Path(weights).read_text(encoding="utf-8")}


STAGES: Final[Sequence[StageEntry]] = (Weigh(),)
PART: Final = RuntimePart(
    read=read,
    stages=STAGES,
    products={"sums": "weighed"},
    know=know,
    outputs=product_outputs(
        make,
        suffix=".npz",
        beside=lambda _: (".txt",),
        formats={"tiff": ".tif"},
        identity=_identity,
    ),
    of_capture=frozenset(),
)
