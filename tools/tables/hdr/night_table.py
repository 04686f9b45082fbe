"""Tables 5.4 and 5.5: which optics, read by which network, bring clipped lights back?

    python -m tools.tables hdr train --out-dir out/tables --data PICTURES
    python -m tools.tables hdr measure --runs out/tables --data HDR -o docs/results/hdr-tables.json

Rows with the networks of the thesis need weights of VGG-19 (`--vgg FILE`) and are left out without.
`measure` photographs night scenes and the HDR pictures of a folder as `camkit bench --saturate
0.015` does (mosaics, ISO 100, 12 bits). What is in the journal holds as long as nothing changed
that decides it: the scene, the optics, the checkpoint, and the source of the solve where the row
has one.

References: Sun 2021, tables 5.4 and 5.5.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, Final

import camkit.runtime.kinds.hdr.streaks
from camkit.arrays import FloatArray
from camkit.errors import CamkitError, ContractError
from camkit.report.bench.metrics.hdr import METRIC
from camkit.report.kinds.hdr.capture import photograph
from camkit.report.quality import Exposed
from camkit.runtime.kinds.hdr.stages import highlights
from tools.tables.equal_training import Trainee, checkpoint_of, finished
from tools.tables.hdr.night_record import (
    ALIGNED,
    COLUMNS,
    OF_BARE,
    Measured,
    record_of,
    tables_text,
)
from tools.tables.hdr.night_scenes import (
    LDR_LIMIT_DB,
    MOST_NIGHTS,
    NIGHT,
    Scene,
    file_scenes,
    night_scenes,
)
from tools.tables.hdr.plates import RECIPES, material_of, write_camera
from tools.tables.hdr.restoring import Camera, Restorer, make_restorer, timed
from tools.tables.journal import Entry, digest, file_digest
from tools.tables.recipe_text import with_keys
from tools.tables.runner import Record, Request, Table
from tools.tables.table_rows import Row, Run, chosen_rows, read_rows

NIGHTS: Final = 33
CAMERAS: Final = "cameras"
LACKS_VGG: Final = "needs weights of VGG-19: give --vgg FILE"
ROWS: Final = read_rows(Path(__file__).with_name("rows.toml"))
LDR: Final = ROWS[0]
"""The bare lens, clipped."""

Scores = Mapping[str, float]


def trainee(run: Run, options: Namespace) -> Trainee | str:
    """Return the network of a row; the reason where it cannot be trained."""
    if run.row.needs_vgg and options.vgg is None:
        return LACKS_VGG
    return Trainee(
        run=run,
        recipe=recipe_text(run),
        material=lambda: material_of(run.row.optics),
        vgg=options.vgg if run.row.needs_vgg else None,
    )


def recipe_text(run: Run) -> str:
    """Return the shipped recipe of a row with its plate and seed in place of its own."""
    shipped = (RECIPES / run.row.recipe).read_text(encoding="utf-8")
    text = with_keys(shipped, "plate", {"file": run.row.optics})
    return with_keys(text, "schedule", {"seed": run.seed})


class Bench:
    """Cameras and restorers of one folder of trainings; a scene is photographed once a plate."""

    def __init__(self, request: Request) -> None:
        self._request = request
        self._cameras: dict[str, Camera] = {}
        self._restorers: dict[str, Restorer] = {}
        self._photograph: tuple[tuple[str, str], Exposed, Scores] | None = None

    def entry(self, run: Run, scene: Scene) -> Entry:
        """Return a run on a scene; what is not known yet is measured.

        Raises:
            CamkitError: If the scene cannot be read or photographed.
        """
        key = self._digest(run, scene)
        return self._request.entry(key, lambda: self._measured(run, scene), _line)

    def _measured(self, run: Run, scene: Scene) -> Entry:
        exposed, of_bare = self._exposed(scene, run.row.optics)
        if run.name not in self._restorers:
            camera = self._camera(run.row.optics)
            self._restorers[run.name] = make_restorer(run, camera, self._request.runs)
        picture, cpu_s = timed(self._restorers[run.name], exposed)
        every = _scores(picture, exposed)
        scores = {n: round(every[n], 4) for n in (*COLUMNS, *ALIGNED) if n in every}
        if "unclipped_psnr_db" in of_bare:
            scores[OF_BARE] = round(of_bare["unclipped_psnr_db"], 4)
        return {"run": run.name, "scene": scene.name, "cpu_s": round(cpu_s, 3), "scores": scores}

    def _exposed(self, scene: Scene, plate: str) -> tuple[Exposed, Scores]:
        """Return a photograph, and the scores of the bare lens beside it."""
        key = scene.name, plate
        if self._photograph is None or self._photograph[0] != key:
            bundle = self._camera(plate).bundle
            shot = photograph(scene.shot(), scene.light(bundle), bundle, bundle.frozen_optics)
            self._photograph = key, shot, _scores(shot.extras["input"], shot)
        return self._photograph[1:]

    def _camera(self, plate: str) -> Camera:
        if plate not in self._cameras:
            folder = self._request.runs / CAMERAS
            folder.mkdir(parents=True, exist_ok=True)
            frozen, bundle = write_camera(folder, plate)
            self._cameras[plate] = Camera(bundle=bundle, frozen=frozen)
        return self._cameras[plate]

    def _digest(self, run: Run, scene: Scene) -> str:
        decides = [run.name, scene.digest(), file_digest(self._camera(run.row.optics).frozen)]
        if run.row.recipe:
            decides.append(file_digest(checkpoint_of(self._request.runs, run)))
        if run.row.method in {"physics", "network"}:
            decides.append(_source_digest())
        return digest(*decides)


def measure(request: Request) -> Record:
    """Measure every row that is trained on every scene; the bare lens is always among them.

    Raises:
        ContractError: If there is no such row, or no scene is wanted.
    """
    listed = chosen_rows(ROWS, request.options.rows)
    rows = listed if LDR in listed else (LDR, *listed)
    nights: int = request.options.scenes
    if nights < 1:
        raise ContractError(f"--scenes must be >= 1; got {nights}")
    bench, measured = Bench(request), Measured()
    scenes = _grouped(bench, measured, nights, request.options.data)
    if (fewer := len(measured.groups.get(NIGHT, ()))) < nights:
        request.tell(f"only {fewer} night scenes of LDR <= {LDR_LIMIT_DB:g} dB, wanted {nights}")
    for scene in scenes:
        for run in _measurable(rows, request.runs, measured):
            measured.entries[run.name, scene.name] = bench.entry(run, scene)
    return record_of(LDR.key, rows, measured, request.trained(rows))


def _measurable(rows: Iterable[Row], runs: Path, measured: Measured) -> list[Run]:
    """Return runs that are trained, those of one plate together; name the other rows."""
    by_plate: dict[str, list[Run]] = {}
    for row in rows:
        missing = [r.name for r in row.runs if row.recipe and finished(runs / r.training) is None]
        if missing:
            why = LACKS_VGG if row.needs_vgg else f"not trained yet: {', '.join(missing)}"
            measured.rows_left_out[row.key] = why
        else:
            by_plate.setdefault(row.optics, []).extend(row.runs)
    return [run for of_plate in by_plate.values() for run in of_plate]


def _line(entry: Entry) -> str:
    decibels = entry["scores"]["hdr_psnr_db"]
    return f"{entry['run']} on {entry['scene']}: {decibels:.2f} dB, {entry['cpu_s']:.2f} CPU-s"


def _scores(picture: FloatArray, exposed: Exposed) -> Scores:
    return METRIC.measure(picture, exposed.extras["linear"], **exposed.extras)


def _grouped(
    bench: Bench, measured: Measured, nights: int, pictures: Path | None
) -> Sequence[Scene]:
    """Measure the bare lens, by which scenes fall into their groups."""
    scenes: list[Scene] = []
    (bare,) = LDR.runs

    def take(scene: Scene) -> None:
        entry = measured.entries[bare.name, scene.name] = bench.entry(bare, scene)
        group = scene.group(entry["scores"]["hdr_psnr_db"])
        measured.groups.setdefault(group, []).append(scene.name)
        scenes.append(scene)

    for scene in islice(night_scenes(), MOST_NIGHTS * nights):
        if len(measured.groups.get(NIGHT, ())) >= nights:
            break
        take(scene)
    for scene in () if pictures is None else file_scenes(pictures):
        try:
            take(scene)
        except CamkitError as error:
            measured.scenes_left_out[scene.name] = str(error).rpartition(": ")[2]
    return scenes


@lru_cache
def _source_digest() -> str:
    """Return a hash of the solve as it stands: what was read by another one is measured again."""
    (folder,) = camkit.runtime.kinds.hdr.streaks.__path__
    files = [*sorted(Path(folder).glob("*.py")), Path(highlights.__file__)]
    return digest(*(path.read_bytes() for path in files))


def _options(measure: ArgumentParser) -> None:
    more: Any = measure.add_argument
    more("--data", type=Path, help="folder of HDR pictures (EXR, HDR)")
    more("--scenes", type=int, default=NIGHTS, help="night scenes with LDR <= 45 dB")
    more("--rows", nargs="+", metavar="ROW", help=f"of {', '.join(row.key for row in ROWS)}")


TABLE: Final = Table(
    description=__doc__,
    rows=lambda _: ROWS,
    trainee=trainee,
    measure=measure,
    to_text=tables_text,
    add_options=_options,
)
