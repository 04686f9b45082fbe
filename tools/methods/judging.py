"""All methods on the same captures, and their CPU-seconds beside each other.

pictures -> fresh copies of the lens, places, ISOs -> every row -> PSNR -> means, paired with S
one capture -> every row in turn, rounds of them -> medians of CPU-seconds a megapixel
"""

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.export.onnx_graph import to_onnx
from camkit.report.bench.machine import processor_name
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import Shot, list_set, read_picture
from tools.comparison.measurement import (
    Measurement,
    Row,
    append_measurements,
    finished_rows,
    identity_of,
    latest,
    measure_all,
    open_rows,
    read_measurements,
)
from tools.comparison.names import CLASSICAL, TITLES
from tools.comparison.paired import mean_and_error, paired_gains
from tools.comparison.peers import PEERS, LocalCapture, Setting
from tools.comparison.photograph import Photograph, Restorer, finish_planes, photograph
from tools.comparison.tuning import Tuned
from tools.methods.developers import DEVELOPERS, DevelopingTime
from tools.methods.equal_minutes import Budget, trained_network
from tools.methods.method_list import METHODS
from tools.methods.plane_methods import (
    PlaneMethod,
    bank_method,
    behind_bank,
    by_kernels,
    on_capture,
    onnx_run,
)
from tools.methods.separate_peer import ROUNDS, STEP_SIZE, TV_WEIGHT, SeparatePeer

ISOS: Final = (100.0, 400.0, 1600.0)
POSITIONS: Final = (0, 2, 4)
"""Of `FIELD_SHARES`: the axis, half-way, the corner."""
REFERENCE: Final = "S"
JUDGED: Final = 1
"""Counts how rows are judged; what was judged before is judged again."""
SHIPPED: Final = " shipped"

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontRow:
    """A method of the front.

    Attributes:
        name: Of the row.
        title: As charts and tables call it.
        kind: classical, bank, trained or shipped.
        runs_in: What computes it.
        restore: Of planes.
        identity: Hash of all that decides it.
        clock: CPU-seconds so far, of all processes that it uses.
    """

    name: str
    title: str
    kind: str
    runs_in: str
    restore: PlaneMethod
    identity: str
    clock: Callable[[], float] = time.process_time


def separate_row(peer: SeparatePeer) -> FrontRow:
    """Return the row of deepinv."""
    return FrontRow(
        name="deepinv",
        title="deepinv ADMM-TV",
        kind="classical",
        runs_in="deepinv, torch",
        restore=peer.restore,
        identity=identity_of(TV_WEIGHT, STEP_SIZE, ROUNDS),
        clock=peer.cpu_s,
    )


def front_rows(bundle: Bundle, budget: Budget, tuned: Tuned) -> list[FrontRow]:
    """Return the classical rows, the bank, what is trained by now, and what the bundle holds."""
    rows = [
        FrontRow(name="input", title=TITLES["input"], kind="classical", runs_in="",
                 restore=lambda capture: capture.planes, identity="input"),
        FrontRow(name="bank", title=TITLES["bank"], kind="bank", runs_in="numpy",
                 restore=bank_method(bundle), identity=bundle.sha256),
    ]  # fmt: skip
    for name in CLASSICAL:
        values = with_middle_iso(tuned[name])
        rows.append(
            FrontRow(
                name=name,
                title=TITLES[name],
                kind="classical",
                runs_in="scikit-image" if name.startswith("skimage") else "numpy",
                restore=_peer(name, values, bundle),
                identity=identity_of(sorted(values.items())),
            )
        )
    rows += [_trained_row(name, bundle, budget) for name in METHODS if budget.is_spent(name)]
    for size in sorted({"S", "M"} & set(bundle.manifest.sizes), reverse=True):
        model = bundle.network_bytes(bundle.manifest.stages_of(Network)[0].role, size)
        rows.append(
            FrontRow(
                name=size + SHIPPED,
                title=f"{size}, as shipped",
                kind="shipped",
                runs_in="onnxruntime",
                restore=behind_bank(bundle, onnx_run(model)),
                identity=bundle.sha256,
            )
        )
    return rows


def with_middle_iso(values: Mapping[float, Setting]) -> dict[float, Setting]:
    """Return settings with that of ISO 400 between those of 100 and 1600, geometrically."""
    low, high = values[ISOS[0]], values[ISOS[2]]
    middle = tuple(float(np.sqrt(a * b)) for a, b in zip(low, high, strict=True))
    return {ISOS[1]: middle, **values}


def _peer(name: str, values: Mapping[float, Setting], bundle: Bundle) -> PlaneMethod:
    def restore(capture: LocalCapture) -> FloatArray:
        return PEERS[name].restore(capture, values[_iso_of(capture, bundle)])

    return restore


def _iso_of(capture: LocalCapture, bundle: Bundle) -> float:
    """Return the ISO whose noise a capture has."""
    sensor = bundle.manifest.light_sensor
    shots = {iso: sensor.noise_at(iso).shot[1] for iso in ISOS}
    return min(ISOS, key=lambda iso: abs(np.log(shots[iso] / capture.noise.shot[1])))


def _trained_row(name: str, bundle: Bundle, budget: Budget) -> FrontRow:
    method, network = METHODS[name], trained_network(name, budget)
    scale = bundle.manifest.stages_of(Network)[0].scale
    runs_in = "onnxruntime"
    if method.feeding == "kernels":
        restore, runs_in = by_kernels(scale, network), "torch"
    elif method.feeding == "capture":
        restore = on_capture(scale, onnx_run(to_onnx(network, channels=3)))
    else:
        restore = behind_bank(bundle, onnx_run(to_onnx(network)))
    weights = hashlib.sha256(budget.checkpoint(name).read_bytes()).hexdigest()
    return FrontRow(
        name=name,
        title=method.title,
        kind="trained",
        runs_in=runs_in,
        restore=restore,
        identity=identity_of(JUDGED, bundle.sha256, weights),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """The captures to judge on.

    Attributes:
        bundle: The camera.
        pictures: Folder.
        count: Pictures of it, the first ones by name; None for all.
        most_px: Side of the middle of a picture that is taken.
        work_dir: Journal and traced PSFs.
    """

    bundle: Bundle
    pictures: Path
    count: int | None
    most_px: int
    work_dir: Path

    def shots(self) -> list[Shot]:
        """Return all captures, the first of every picture first."""
        return [
            Shot(
                set_name=self.pictures.name,
                picture=picture,
                number=number,
                position=position,
                iso=iso,
                psf="fresh",
            )
            for position in POSITIONS
            for iso in ISOS
            for number, picture in enumerate(list_set(self.pictures, self.count))
        ]

    def photographer(self) -> Callable[[Shot], Photograph]:
        """Return the function that photographs a shot through its copy of the lens."""
        psfs = self.work_dir / "psf"
        traced = lru_cache(lambda seed: fabricated_optics(self.bundle, seed, cache_folder=psfs))

        def take(shot: Shot) -> Photograph:
            scene = read_picture(shot.picture, self.most_px)
            return photograph(shot, scene, self.bundle, traced(shot.fabrication_seed))

        return take


def judged(rows: Sequence[FrontRow], protocol: Protocol, tell: Tell) -> list[Measurement]:
    """Measure what the journal lacks; return the measurements of these rows."""
    bundle, journal = protocol.bundle, protocol.work_dir / "judged.jsonl"
    plain = [
        Row(
            name=row.name,
            restore=_finished(row.restore, bundle),
            identity=identity_of(row.identity, protocol.most_px, bundle.sha256),
        )
        for row in rows
    ]
    done = finished_rows(read_measurements(journal))
    shots = protocol.shots()
    work = [(shot, missing) for shot in shots if (missing := open_rows(shot, plain, done))]
    tell(f"{len(shots)} captures, {len(work)} to do, {len(rows)} methods")
    began = time.perf_counter()
    for number, measurements in enumerate(measure_all(work, protocol.photographer()), start=1):
        append_measurements(journal, measurements)
        if number in (1, 3) or number % 10 == 0:
            left_min = (time.perf_counter() - began) / number * (len(work) - number) / 60
            tell(f"{number}/{len(work)}, {left_min:.0f} min left")
    current = {(row.name, row.identity) for row in plain}
    names = {(shot.picture.name, shot.position, shot.iso) for shot in shots}
    return [
        m
        for m in latest(read_measurements(journal))
        if (m.method, m.identity) in current and (m.picture, m.position, m.iso) in names
    ]


def _finished(restore: PlaneMethod, bundle: Bundle) -> Restorer:
    return lambda capture: finish_planes(restore(capture.local), capture, bundle)


def timed(
    rows: Sequence[FrontRow], protocol: Protocol, rounds: int, tell: Tell
) -> dict[str, list[float]]:
    """Return row -> CPU-seconds a megapixel of every round, the rows of a round in turn.

    The first picture is photographed whole, half-way to the corner at ISO 400.
    """
    whole = Protocol(
        bundle=protocol.bundle,
        pictures=protocol.pictures,
        count=1,
        most_px=2**16,
        work_dir=protocol.work_dir,
    )
    middle = POSITIONS[1], ISOS[1]
    shot = next(s for s in whole.shots() if (s.position, s.iso) == middle)
    capture = whole.photographer()(shot).local
    megapixels = capture.planes[0].size / 1e6
    seconds: dict[str, list[float]] = {row.name: [] for row in rows}
    for number in range(rounds):
        for row in rows:
            began = row.clock()
            row.restore(capture)
            seconds[row.name].append((row.clock() - began) / megapixels)
        tell(f"timed round {number + 1} of {rounds}")
    return seconds


def to_record(
    rows: Sequence[FrontRow],
    measurements: Sequence[Measurement],
    seconds: Mapping[str, Sequence[float]],
    developers: Sequence[DevelopingTime],
    budget: Budget,
) -> dict[str, Any]:
    """Return the record of the front, as plain values."""
    gains = paired_gains(measurements, [(row.name, REFERENCE) for row in rows])
    by_method = {gain["method"]: {**gain, "aim_db": None} for gain in gains}
    entries = []
    for row in rows:
        results = [m for m in measurements if m.method == row.name]
        mean_db, error_db = mean_and_error(
            [m.psnr_db for m in results], [m.picture for m in results]
        )
        entries.append(
            {
                "name": row.name,
                "title": row.title,
                "kind": row.kind,
                "runs_in": row.runs_in,
                "captures": len(results),
                "psnr_db": mean_db,
                "error_db": error_db,
                "over_s": by_method.get(row.name),
                "cpu_s_per_mp": float(np.median(seconds[row.name])),
                "cpu_s_spread": [min(seconds[row.name]), max(seconds[row.name])],
                "training": budget.ending(row.name) if row.kind == "trained" else None,
            }
        )
    return {
        "minutes": budget.minutes,
        "machine": processor_name(),
        "pictures": len({m.picture for m in measurements}),
        "isos": list(ISOS),
        "positions": list(POSITIONS),
        "rows": entries,
        "developers": [asdict(developer) for developer in developers],
        "left_out": left_out(rows, developers),
    }


def left_out(rows: Sequence[FrontRow], developers: Sequence[DevelopingTime]) -> dict[str, str]:
    """Return what is not measured here -> why."""
    measured = {row.name for row in rows}
    reasons = {
        METHODS[name].title: "not trained for these minutes"
        for name in METHODS
        if name not in measured
    }
    if "deepinv" not in measured:
        reasons["deepinv"] = "no environment of it was named (--deepinv-python)"
    present = {developer.title for developer in developers}
    return reasons | {title: "not installed here" for title in DEVELOPERS if title not in present}
