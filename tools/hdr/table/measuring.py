"""Every row on every scene, each photographed once per camera; finished work is in a journal.

A line of the journal holds as long as nothing changed that decides it: the scene, the optics, the
checkpoint, and the source of the solve where the row has one.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Final

import camkit.runtime.kinds.hdr.streaks
from camkit.contracts import FloatArray
from camkit.errors import CamkitError
from camkit.report.bench.metrics.hdr import METRIC
from camkit.report.journal import append_journal, read_journal
from camkit.report.kinds.hdr.capture import photograph
from camkit.report.quality import Exposed
from camkit.runtime.kinds.hdr.stages import highlights
from tools.hdr.table.cameras import write_camera
from tools.hdr.table.restoring import Camera, Restorer, make_restorer, timed
from tools.hdr.table.rows import LDR, Row, Run
from tools.hdr.table.scenes import (
    LDR_LIMIT_DB,
    MOST_NIGHTS,
    NIGHT,
    Scene,
    file_scenes,
    night_scenes,
)
from tools.hdr.table.training import LACKS_VGG, checkpoint_of, finished

JOURNAL: Final = "measured.jsonl"
CAMERAS: Final = "cameras"
COLUMNS: Final = (
    *("hdr_psnr_db", "stops_rmse", "unclipped_psnr_db", "mu_psnr_db", "pu21_psnr_db", "jod"),
)
ALIGNED: Final = tuple(f"{name}_aligned" for name in COLUMNS)
OF_BARE: Final = "input_unclipped_psnr_db"
"""Of the bare lens, over the pixels that clip in neither capture of this camera."""

Tell = Callable[[str], None]
Scores = Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A row on a scene.

    Attributes:
        run: Name of the run.
        scene: Name of the scene.
        digest: Of all that decides it.
        cpu_s: For the picture, by one thread.
        scores: Column -> value.
    """

    run: str
    scene: str
    digest: str
    cpu_s: float
    scores: Scores


@dataclass(slots=True, kw_only=True)
class Measured:
    """What was measured.

    Attributes:
        groups: Group -> scenes.
        entries: (run, scene) -> entry.
        rows_left_out: Row -> why.
        scenes_left_out: File -> why.
    """

    groups: dict[str, list[str]] = field(default_factory=dict)
    entries: dict[tuple[str, str], Entry] = field(default_factory=dict)
    rows_left_out: dict[str, str] = field(default_factory=dict)
    scenes_left_out: dict[str, str] = field(default_factory=dict)

    def ldr_db(self, scene: str) -> float:
        """Return the PSNR of the bare lens."""
        return self.entries[LDR.key, scene].scores["hdr_psnr_db"]


class Bench:
    """Cameras, restorers and the journal of one folder of trainings."""

    def __init__(self, runs: Path, tell: Tell) -> None:
        self._runs, self._tell = runs, tell
        self._journal = runs / JOURNAL
        lines = read_journal(self._journal, lambda line: Entry(**line), "measured row")
        self._known = {(entry.run, entry.scene, entry.digest): entry for entry in lines}
        self._cameras: dict[str, Camera] = {}
        self._restorers: dict[str, Restorer] = {}

    def entries(self, scene: Scene, runs: Iterable[Run]) -> list[Entry]:
        """Return runs of one plate on a scene; what is not known yet is measured.

        Raises:
            CamkitError: If the scene cannot be read or photographed.
        """
        keyed = [(run, self._digest(run, scene)) for run in runs]
        missing = [run for run, d in keyed if (run.name, scene.name, d) not in self._known]
        if missing:
            exposed = self._exposed(scene, missing[0].row.plate)
            of_bare = _scores(exposed.extras["input"], exposed)
            for run in missing:
                self._add(run, scene, exposed, of_bare)
        return [self._known[run.name, scene.name, digest] for run, digest in keyed]

    def _add(self, run: Run, scene: Scene, exposed: Exposed, of_bare: Scores) -> None:
        if run.name not in self._restorers:
            camera = self._camera(run.row.plate)
            self._restorers[run.name] = make_restorer(run, camera, self._runs)
        picture, cpu_s = timed(self._restorers[run.name], exposed)
        found = _scores(picture, exposed)
        scores = {n: round(found[n], 4) for n in (*COLUMNS, *ALIGNED) if n in found}
        if "unclipped_psnr_db" in of_bare:
            scores[OF_BARE] = round(of_bare["unclipped_psnr_db"], 4)
        entry = Entry(
            run=run.name,
            scene=scene.name,
            digest=self._digest(run, scene),
            cpu_s=round(cpu_s, 3),
            scores=scores,
        )
        names = ("run", "scene", "digest", "cpu_s", "scores")
        append_journal(self._journal, [{name: getattr(entry, name) for name in names}])
        self._known[entry.run, entry.scene, entry.digest] = entry
        self._tell(f"{run.name} on {scene.name}: {scores['hdr_psnr_db']:.2f} dB, {cpu_s:.2f} CPU-s")

    def _exposed(self, scene: Scene, plate: str) -> Exposed:
        bundle = self._camera(plate).bundle
        return photograph(scene.shot(), scene.light(bundle), bundle, bundle.frozen_optics)

    def _camera(self, plate: str) -> Camera:
        if plate not in self._cameras:
            folder = self._runs / CAMERAS
            folder.mkdir(parents=True, exist_ok=True)
            frozen, bundle = write_camera(folder, plate)
            self._cameras[plate] = Camera(bundle=bundle, frozen=frozen)
        return self._cameras[plate]

    def _digest(self, run: Run, scene: Scene) -> str:
        decides = [scene.digest(), self._camera(run.row.plate).bundle.sha256]
        if run.row.recipe:
            decides.append(_file_digest(checkpoint_of(self._runs, run)))
        if run.row.method in {"physics", "network"}:
            decides.append(_source_digest())
        return hashlib.sha256(" ".join(decides).encode()).hexdigest()[:32]


def measure_rows(
    rows: Iterable[Row], runs: Path, nights: int, pictures: Path | None, tell: Tell
) -> Measured:
    """Measure every row that is trained on every scene.

    Args:
        rows: Those asked for; LDR is always there.
        runs: Folder of trainings.
        nights: Night scenes that are wanted of LDR <= 45 dB; those with more that are met on the
            way are judged apart.
        pictures: Folder of HDR pictures; None for none.
        tell: Takes a line for everything that was measured.
    """
    runs.mkdir(parents=True, exist_ok=True)
    bench, found = Bench(runs, tell), Measured()
    scenes = _grouped(bench, found, nights, pictures)
    if (fewer := len(found.groups.get(NIGHT, ()))) < nights:
        tell(f"only {fewer} night scenes of LDR <= {LDR_LIMIT_DB:g} dB, wanted {nights}")
    by_plate: dict[str, list[Run]] = {}
    for row in rows:
        if row.recipe and (missing := _obstacle(row, runs)):
            found.rows_left_out[row.key] = missing
        else:
            by_plate.setdefault(row.plate, []).extend(row.runs)
    for scene in scenes:
        for entry in (e for of_plate in by_plate.values() for e in bench.entries(scene, of_plate)):
            found.entries[entry.run, entry.scene] = entry
    return found


def _scores(picture: FloatArray, exposed: Exposed) -> Scores:
    extras = exposed.extras
    return METRIC.measure(picture, extras["linear"], **extras)


def _obstacle(row: Row, runs: Path) -> str | None:
    """Return why a row with networks cannot be measured; None if all of them are trained."""
    missing = [run.name for run in row.runs if finished(runs, run) is None]
    if not missing:
        return None
    return LACKS_VGG if row.needs_vgg else f"not trained yet: {', '.join(missing)}"


def _grouped(bench: Bench, found: Measured, nights: int, pictures: Path | None) -> list[Scene]:
    """Measure the bare lens, by which scenes fall into their groups."""
    scenes: list[Scene] = []

    def take(scene: Scene) -> None:
        (entry,) = bench.entries(scene, LDR.runs)
        found.entries[entry.run, entry.scene] = entry
        group = scene.group(entry.scores["hdr_psnr_db"])
        found.groups.setdefault(group, []).append(scene.name)
        scenes.append(scene)

    for scene in islice(night_scenes(), MOST_NIGHTS * nights):
        if len(found.groups.get(NIGHT, ())) >= nights:
            break
        take(scene)
    for scene in () if pictures is None else file_scenes(pictures):
        try:
            take(scene)
        except CamkitError as error:
            found.scenes_left_out[scene.name] = str(error).rpartition(": ")[2]
    return scenes


@lru_cache
def _file_digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@lru_cache
def _source_digest() -> str:
    """Return a hash of the solve as it stands: lines of another one are measured again."""
    (folder,) = camkit.runtime.kinds.hdr.streaks.__path__
    files = [*sorted(Path(folder).glob("*.py")), Path(highlights.__file__)]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
