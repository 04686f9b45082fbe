"""A real lens: its traced blur against photographs, and photographs restored by it.

    python -m tools.comparison.real_lens --data FOLDER -o docs/results/real-lens --crops CROPS

FOLDER holds `rf50mm.zmx` and the photographs of LinYark/Sdirt (commit 5fa8ff5, MIT), named
1500_f4_l.png and so on. Forward: `camkit.calibrate.distance` on the pair at 1.5 m. Inverse: the
picture at f/4 restored by cameras of `camkit.make`, judged by the picture at f/20 as every blur is
judged. `--held-out FOLDER` (f4/l.png, ..., at 0.6 m) is judged with what was fitted at 1.5 m.
Writes NAME.json, NAME.md and crops.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

import camkit
from camkit.arrays import FloatArray
from camkit.calibrate import PairWords
from camkit.calibrate.lens_distance import plain_rows
from camkit.calibrate.pair_scene import PairScene, read_scene_pair
from camkit.calibrate.placed_pair import PlacedPair, place_pair
from camkit.calibration.blur_pair.blur_errors import BlurErrors, Judge
from camkit.calibration.blur_pair.distance_facts import BlurRow, DistanceFacts
from camkit.report.bench.machine import describe_machine
from camkit.report.making.camera_steps import FILTER_BUNDLE, CameraSteps, CameraWish
from camkit.report.making.work_folder import WorkFolder
from camkit.runtime.signal.halves import Halves
from camkit.runtime.signal.tone_curve import read_tone
from camkit.stopwatch import Stopwatch
from tools.comparison.real_lens_pages import page_text, write_crops
from tools.tables.records import to_compact_json

TONE: Final = Path(__file__).with_name("real-lens-tone.toml")
LENS: Final = "rf50mm.zmx"
SENSOR: Final = "768x512@46.875um"
FOCUS_M: Final = 1.0
STOPS_MM: Final = (3.65, 0.73)
"""Radii of the stop at f/4, as the authors state it, and at f/20, a fifth of it."""
METHODS: Final = ("wiener", "rl")
SLOW_METHOD: Final = "admm-tv"
"""Of the first camera alone."""
FIRST_READ: Final[Mapping[str, Any]] = {"distance_from": "sensor", "glass": ("names",)}
"""As camkit took the file before it compared glasses, with the distances of the lens's scale."""
PLAIN: Final = str.maketrans("", "", "(),'")
DIGITS: Final = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """Two photographs of the poster.

    Attributes:
        name: Of the distance.
        files: Wide and sharp, the left halves.
        halves: As of `process`.
        object_m: Distance of the poster.
    """

    name: str
    files: tuple[Path, Path]
    halves: Halves
    object_m: float

    @property
    def words(self) -> PairWords:
        """Return the use of the lens."""
        return PairWords(
            focus_m=FOCUS_M,
            object_m=self.object_m,
            stop_radius_mm=STOPS_MM[0],
            sharp_stop_radius_mm=STOPS_MM[1],
            sensor=f"{SENSOR}:planes",
        )


class Comparison:
    """A shot, read by one tone curve, with the lens as it was found."""

    def __init__(self, lens: Path, shot: Shot, facts: DistanceFacts, tone: Path) -> None:
        """Keep all.

        Args:
            lens: Lens file.
            shot: The photographs.
            facts: Fitted, on this shot or on another one.
            tone: Curve.
        """
        self.lens, self.shot, self.facts, self.tone = lens, shot, facts, tone

    @cached_property
    def scene(self) -> PairScene:
        """Return the photographs, registered."""
        shot = self.shot
        return read_scene_pair(shot.files, [read_tone(self.tone)], shot.halves, shot.words)

    def forward(self) -> list[BlurRow]:
        """Return every blur: those without a lens fitted to this very shot, the lens as found."""
        rows = plain_rows([self.scene], self.tone.name)
        for origin in self._lenses.rays:
            for shift in dict.fromkeys((0.0, self.facts.fits[origin].best)):
                errors = self.scene.errors(self._lenses.transfers(origin, shift))[self.tone.name]
                setting = f"sensor moved by {shift:+.3f} mm" if shift else "in best focus"
                rows.append(BlurRow(name=f"lens, from {origin}", setting=setting, errors=errors))
        return rows

    def predicted(self) -> FloatArray:
        """Return the sharp picture blurred by the lens as it was found, in light."""
        transfers = self._lenses.transfers(self.facts.origin, self.facts.fit.best)
        judge = self.scene.judges[self.tone.name]
        blurred = self.scene.grid.blurred(judge.pair.sharp, lambda b: transfers[b.index])
        return judge.scaled(blurred)

    def inverse(
        self, folder: Path, origins: Sequence[str], others: Sequence[Path] = ()
    ) -> dict[str, FloatArray]:
        """Return the wide picture restored in every way, in light.

        Args:
            folder: For the bundles.
            origins: Of distances, of which a camera each is made.
            others: Further bundles, whose best method is taken.
        """
        cameras = {f"from {one}": self.facts.options_of(one) for one in origins}
        first = next(iter(cameras))
        pictures = {"untouched": self._judge().pair.sharp}
        for title, words in {**cameras, "as first read": FIRST_READ}.items():
            settings = "-".join(map(str, words.values())).translate(PLAIN)
            bundle = folder / f"rf50-{self.shot.object_m:g}m-{settings}.camkit"
            self._make(bundle, words)
            for method in (*METHODS, SLOW_METHOD) if title == first else METHODS:
                pictures[f"{method}, {title}"] = self._restored(bundle, method)
        for bundle in others:
            pictures[bundle.stem] = self._restored(bundle, None)
        return pictures

    @cached_property
    def _lenses(self) -> PlacedPair:
        return place_pair(self.lens, self.shot.words, self.shot.object_m, self.scene)

    def judged(self, picture: FloatArray) -> BlurErrors:
        """Return the errors of a restored picture against the sharp one."""
        return self._judge().errors(picture)

    def scaled(self, picture: FloatArray) -> FloatArray:
        """Return a restored picture at the brightness of the sharp one."""
        return self._judge().scaled(picture)

    def _judge(self) -> Judge:
        """Return what judges restored pictures: the pair the other way round."""
        judge = self.scene.judges[self.tone.name]
        pair = replace(judge.pair, wide=judge.pair.sharp, sharp=judge.pair.wide)
        return Judge(pair, self.scene.grid, judge.counted)

    def _make(self, bundle: Path, words: Mapping[str, Any]) -> None:
        """Make a camera as the first steps of `camkit make`, unless it is there."""
        if bundle.exists():
            return
        camera = camkit.CameraWords(
            sensor=f"{SENSOR}:planes",
            stop_radius_mm=STOPS_MM[0],
            focus_m=FOCUS_M,
            object_m=(self.shot.object_m,),
            **words,
        )
        wish = CameraWish(
            optics=self.lens,
            camera=camera,
            name="rf50",
            size="S",
            start=Path("duet"),
            data=None,
            valid=None,
            workers=1,
            minutes=0.0,
        )
        with TemporaryDirectory() as folder:
            work = WorkFolder(Path(folder) / "work", wish.to_json(), Stopwatch())
            steps = CameraSteps(wish=wish, work=work)
            steps.describe()
            steps.freeze()
            steps.export_filter()
            steps.ship(FILTER_BUNDLE, bundle)

    def _restored(self, bundle: Path, method: str | None) -> FloatArray:
        """Return the wide picture restored by a bundle, in light; kept beside the bundle."""
        store = bundle.with_name(f"{bundle.stem}-{method or 'best'}-{self.shot.object_m:g}m.npy")
        if store.exists():
            return np.asarray(np.load(store))
        pipeline = camkit.load(
            bundle,
            method=method,
            tone=self.tone,
            halves=self.shot.halves,
            undistort=False,
            vignetting=False,
        )
        picture = np.asarray(pipeline.process(self.shot.files[0]).image)
        np.save(store, picture)
        return picture


def main(words: Sequence[str] | None = None) -> None:
    """Compare, and write the record, the page and the crops."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="lens and photographs at 1.5 m")
    parser.add_argument("--held-out", type=Path, help="photographs at 0.6 m, judged alone")
    parser.add_argument("--tone", type=Path, default=TONE, help="the maker's curve")
    parser.add_argument("--bundle", type=Path, action="append", default=[], help="also judged")
    parser.add_argument("--work-dir", type=Path, help="keeps bundles and pictures")
    parser.add_argument("--crops", type=Path, help="folder for pictures")
    parser.add_argument("-o", "--output", type=Path, required=True, help="without suffix")
    arguments = parser.parse_args(words)
    shots = shots_of(arguments.data, arguments.held_out)
    lens = arguments.data / LENS
    facts = camkit.calibrate.distance(
        shots[0].files,
        lens,
        words=shots[0].words,
        tones=("srgb", arguments.tone),
        halves=shots[0].halves,
    )
    output = arguments.output
    output.parent.mkdir(parents=True, exist_ok=True)
    record: dict[str, Any] = {"machine": describe_machine(), "distance": facts.to_record()}
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) if arguments.work_dir is None else arguments.work_dir
        folder.mkdir(parents=True, exist_ok=True)
        for shot in shots:
            comparison = Comparison(lens, shot, facts, arguments.tone)
            is_fitted = shot is shots[0]
            origins = (facts.origin,) if is_fitted else facts.alike
            others = arguments.bundle if is_fitted else ()
            pictures = comparison.inverse(folder, origins, others)
            record[shot.name] = {
                "forward": [row.to_record() for row in comparison.forward()],
                "share": comparison.scene.share,
                "registration": comparison.scene.registration.to_record(),
                "inverse": [
                    {"method": name, **comparison.judged(picture).to_record()}
                    for name, picture in pictures.items()
                ],
            }
            text = to_compact_json(record, DIGITS)
            output.with_suffix(".json").write_text(text + "\n", encoding="utf-8")
            print(shot.name, json.dumps(record[shot.name]["inverse"]), flush=True)
            if arguments.crops is not None:
                write_crops(arguments.crops, comparison, pictures)
    names = [shot.name for shot in shots]
    output.with_suffix(".md").write_text(page_text(record, names), encoding="utf-8")


def shots_of(data: Path, held_out: Path | None) -> list[Shot]:
    """Return the photographs: the pair to fit on first."""
    shots = [
        Shot(
            name="1500 mm",
            files=(data / "1500_f4_l.png", data / "1500_f20_l.png"),
            halves=("_l", "_r"),
            object_m=1.5,
        )
    ]
    if held_out is not None:
        files = (held_out / "f4" / "l.png", held_out / "f20" / "l.png")
        shots.append(Shot(name="600 mm", files=files, halves=("l", "r"), object_m=0.6))
    return shots


if __name__ == "__main__":
    main()
