"""Measurements of a long run: one JSON line each as they are finished, read again to resume."""

import hashlib
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from camkit.arrays import FloatArray
from camkit.report.journal import append_journal, read_journal
from camkit.report.quality import PsfSource, Shot, judge
from tools.comparison.photograph import Photograph, Restorer

CAPTURE_COLUMNS: Final = (
    "psf",
    "set_name",
    "picture",
    "position",
    "height_mm",
    "iso",
    "seed",
    "megapixels",
)
VALUE_COLUMNS: Final = ("psnr_db", "ssim", "seconds")


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One method on one capture.

    Attributes:
        psf: Lens of the capture: fresh (fabricated, traced afresh) or bundle.
        set_name: Folder of the picture.
        picture: File name.
        position: Index of the field position.
        height_mm: Distance of the crop's middle from the axis.
        iso: Sensitivity.
        seed: Of the fabrication errors; None through the bundle's own PSF.
        method: Name of the row.
        psnr_db: On sRGB values.
        ssim: On sRGB values.
        seconds: Of the method alone.
        megapixels: Of the picture.
        identity: Hash of all that decides the value besides the capture.
    """

    psf: PsfSource
    set_name: str
    picture: str
    position: int
    height_mm: float
    iso: float
    seed: int | None
    method: str
    psnr_db: float
    ssim: float
    seconds: float
    megapixels: float
    identity: str

    @property
    def capture(self) -> tuple[str, str, str, int, float]:
        """Return what names the capture."""
        return self.psf, self.set_name, self.picture, self.position, self.iso


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A method of the comparison.

    Attributes:
        name: As it stands in the tables.
        restore: Capture to linear Rec.709.
        identity: Hash of bundle members and parameters.
    """

    name: str
    restore: Restorer
    identity: str


def identity_of(*parts: object) -> str:
    """Return a short hash of plain values."""
    return hashlib.sha256(json.dumps(parts, default=str).encode()).hexdigest()[:12]


def shot_key(shot: Shot) -> tuple[str, str, str, int, float]:
    """Return what names the capture, as `Measurement.capture`."""
    return shot.psf, shot.set_name, shot.picture.name, shot.position, shot.iso


def read_measurements(path: Path) -> list[Measurement]:
    """Read the measurements of an earlier run.

    Raises:
        ContractError: If the journal is damaged.
    """
    return read_journal(path, lambda entry: Measurement(**entry), "measurement")


def append_measurements(path: Path, measurements: Iterable[Measurement]) -> None:
    """Add finished measurements to a journal."""
    append_journal(path, (asdict(m) for m in measurements))


def open_rows(
    shot: Shot, rows: Sequence[Row], done: Mapping[tuple[object, ...], set[tuple[str, str]]]
) -> tuple[Row, ...]:
    """Return the rows that still have to be measured on a capture."""
    finished = done.get(shot_key(shot), set())
    return tuple(row for row in rows if (row.name, row.identity) not in finished)


def finished_rows(
    measurements: Iterable[Measurement],
) -> dict[tuple[object, ...], set[tuple[str, str]]]:
    """Return capture -> (name, identity) of the rows measured on it."""
    done: dict[tuple[object, ...], set[tuple[str, str]]] = {}
    for m in measurements:
        done.setdefault(m.capture, set()).add((m.method, m.identity))
    return done


def latest(measurements: Iterable[Measurement]) -> list[Measurement]:
    """Keep one measurement of every method and capture, the last: two runs may share a journal."""
    return list({(m.capture, m.method): m for m in measurements}.values())


def by_capture(measurements: Iterable[Measurement], methods: Sequence[str]) -> list[list[Any]]:
    """Return a row a capture: CAPTURE_COLUMNS, then VALUE_COLUMNS of every method, None without."""
    rows: dict[tuple[object, ...], dict[str, Measurement]] = {}
    for m in measurements:
        rows.setdefault(m.capture, {})[m.method] = m
    table = []
    for by_method in rows.values():
        first = next(iter(by_method.values()))
        values = [
            [getattr(by_method[name], column) for column in VALUE_COLUMNS]
            if name in by_method
            else None
            for name in methods
        ]
        table.append([*(getattr(first, column) for column in CAPTURE_COLUMNS), *values])
    return table


def measure(
    shot: Shot, rows: Sequence[Row], photograph: Callable[[Shot], Photograph]
) -> list[Measurement]:
    """Photograph once and measure every row on it."""
    capture = photograph(shot)
    measurements = []
    for row in rows:
        began = time.perf_counter()
        restored: FloatArray = row.restore(capture)
        seconds = time.perf_counter() - began
        score = judge(restored, capture.sharp)
        measurements.append(
            Measurement(
                psf=shot.psf,
                set_name=shot.set_name,
                picture=shot.picture.name,
                position=shot.position,
                height_mm=round(capture.height_mm, 3),
                iso=shot.iso,
                seed=shot.fabrication_seed if shot.psf == "fresh" else None,
                method=row.name,
                psnr_db=round(score.psnr_db, 4),
                ssim=round(score.ssim, 5),
                seconds=round(seconds, 4),
                megapixels=round(restored[0].size / 1e6, 4),
                identity=row.identity,
            )
        )
    return measurements


def measure_all(
    work: Sequence[tuple[Shot, Sequence[Row]]],
    photograph: Callable[[Shot], Photograph],
    *,
    jobs: int = 1,
    limit_s: float | None = None,
) -> Iterator[list[Measurement]]:
    """Measure captures in order, several at a time, until all are done or the time is up.

    Args:
        work: Captures with the rows to measure on each.
        photograph: Photographs one.
        jobs: Captures at a time (threads).
        limit_s: No capture is begun after this many seconds.
    """
    began = time.perf_counter()

    def one(item: tuple[Shot, Sequence[Row]]) -> list[Measurement]:
        if limit_s is not None and time.perf_counter() - began > limit_s:
            return []
        return measure(item[0], item[1], photograph)

    with ThreadPoolExecutor(max_workers=jobs) as pool:
        yield from (measurements for measurements in pool.map(one, work) if measurements)
