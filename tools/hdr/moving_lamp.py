r"""Lamps that move or flash: a bracket of three exposures beside one capture through a plate.

    python -m tools.hdr.moving_lamp --bundle streak-hdr -o docs/results/hdr-moving-lamp.json

Night streets without their own lights, and lamps of up to 200 times white put into them. The
bracket (0, -4 and -8 EV, one after the other through the bare lens) is merged by what `camkit
merge` does, which aligns nothing and looks for no ghosts; the snapshot is one capture through the
plate at the moment of the first frame, restored by the bundle. Both have the noise of ISO 100. The
truth is the scene at that moment. Lamps move by so many pixels from frame to frame, each in a
direction of its own; a lamp that flashes is on in each frame by chance, one half. Within a frame
everything stands still.
"""

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor
from camkit.contracts import FloatArray
from camkit.errors import UnsupportedError
from camkit.report.hdr_score import Reference, hdr_scores
from camkit.report.kinds.hdr.capture import capture_of, clipped_planes, developer
from camkit.report.kinds.hdr.lights import dimmed, with_lamp
from camkit.report.quality import BORDER_PX
from camkit.report.sensor_geometry import in_sensor_geometry
from camkit.runtime.files.picture import read_light
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.runtime.merging.result import merge_to_exr
from camkit.runtime.merging.survey import survey
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph, write_capture
from camkit.runtime.twin.truth import true_picture
from camkit.scenes.saturation import CEILING, with_exposure
from tools.hdr.record import in_one_line, new_parser, open_camera, origin_of, table, write_record

SEEDS: Final = tuple(range(8))
SIDE_PX: Final = 384
SHARE: Final = 0.015
"""Of the pixels, in lamps; and above white in the night whose lights they replace."""
TIMES: Final = (1.0, 2.0**-4, 2.0**-8)
RADII_PX: Final = (2.0, 10.0)
POWERS: Final = (4.0, 200.0)
KEPT: Final = ("hdr_psnr_db", "stops_rmse", "unclipped_psnr_db")
BRACKET: Final = "bracket"
INPUT: Final = "input"


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What lamps do between the frames.

    Attributes:
        name: For reports.
        step_px: They move from each frame to the next.
        flashing: Whether they go on and off.
    """

    name: str
    step_px: float = 0.0
    flashing: bool = False


CASES: Final = (
    Case(name="still"),
    *(Case(name=f"moving {step:g} px", step_px=step) for step in (0.5, 1, 2, 4, 8)),
    Case(name="flashing", flashing=True),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lamp:
    """A lamp.

    Attributes:
        centre_px: (y, x) in the first frame.
        radius_px: Of it.
        colour: (r, g, b) of its middle, in times white.
        angle_rad: Where it goes, from +x towards +y.
        shines: In which frames, where lamps flash.
    """

    centre_px: tuple[float, float]
    radius_px: float
    colour: tuple[float, float, float]
    angle_rad: float
    shines: tuple[bool, ...]


@in_one_line
def main() -> None:
    """Print a table."""
    parser = new_parser(__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    arguments = parser.parse_args()
    bundle = open_camera(arguments.bundle, arguments.sizes)
    found = {
        case.name: [measure(case, seed, bundle, arguments.sizes) for seed in arguments.seeds]
        for case in CASES
    }
    means = {name: mean_of(scenes) for name, scenes in found.items()}
    record = {**origin_of(bundle, arguments.sizes), "means": means, "scenes": found}
    print(to_text(means))
    write_record(arguments.output, record)


def measure(
    case: Case, seed: int, bundle: Bundle, sizes: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Photograph a scene both ways and give the numbers of each: way -> number -> value."""
    sensor = bundle.manifest.sensor
    if not isinstance(sensor, BayerSensor):
        raise UnsupportedError(f"bundle {bundle.manifest.name} has no mosaic; brackets are RAW")
    scenes = frames(case, seed, sensor)
    shots = [
        photograph(scene, bundle, _taken(bundle, 10 * seed + n, plate=False, exposure=time))
        for n, (scene, time) in enumerate(zip(scenes, TIMES, strict=True))
    ]
    coded = photograph(scenes[0], bundle, _taken(bundle, 10 * seed + len(TIMES)))
    plain = developer(bundle, threads=1)
    bare, seen = capture_of(plain, shots[0]), capture_of(plain, coded)
    pictures = {INPUT: plain.start(bare).fill(), BRACKET: merged(shots, bundle)}
    for name, pipeline in _restoring(bundle, sizes).items():
        pictures[name] = pipeline.start(capture_of(pipeline, coded)).fill()
    reference = Reference(
        truth=true_picture(shots[0].clean, sensor),
        clipped=np.logical_or(clipped_planes(bare), clipped_planes(seen)),
    )
    inside = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    inner = reference.within(inside)
    return {
        name: {k: round(v, 3) for k, v in hdr_scores(p[inside], inner).items() if k in KEPT}
        for name, p in pictures.items()
    }


def frames(case: Case, seed: int, sensor: BayerSensor) -> list[FloatArray]:
    """Return the scene (3, h, w) at the moment of every frame; the same lamps for every case."""
    night = night_scene(seed, SIDE_PX, SIDE_PX)
    dark = dimmed(with_exposure(night, exposure_for_share(night, sensor, SHARE).exposure))
    lamps = draw_lamps(np.random.default_rng(seed))
    found = []
    for number in range(len(TIMES)):
        scene = dark
        for lamp in lamps:
            if lamp.shines[number] or not case.flashing:
                scene = _with(scene, lamp, number * case.step_px)
        found.append(np.minimum(scene, np.float32(CEILING)))
    return found


def draw_lamps(rng: np.random.Generator) -> list[Lamp]:
    """Draw lamps until they cover their share of the picture."""
    lamps: list[Lamp] = []
    margin = BORDER_PX + 2 * RADII_PX[1] + max(case.step_px for case in CASES) * len(TIMES)
    while sum(math.pi * lamp.radius_px**2 for lamp in lamps) < SHARE * SIDE_PX**2:
        y, x = rng.uniform(margin, SIDE_PX - margin, 2).tolist()
        power = math.exp(rng.uniform(*np.log(POWERS)))
        red, green, blue = (power * rng.uniform(0.4, 1.0, 3)).tolist()
        lamps.append(
            Lamp(
                centre_px=(y, x),
                radius_px=math.exp(rng.uniform(*np.log(RADII_PX))),
                colour=(red, green, blue),
                angle_rad=float(rng.uniform(0, 2 * math.pi)),
                shines=tuple((rng.random(len(TIMES)) < 0.5).tolist()),
            )
        )
    return lamps


def _with(scene: FloatArray, lamp: Lamp, gone_px: float) -> FloatArray:
    y, x = lamp.centre_px
    centre = y + gone_px * math.sin(lamp.angle_rad), x + gone_px * math.cos(lamp.angle_rad)
    planes = zip(scene, lamp.colour, strict=True)
    return np.concatenate([with_lamp(p[None], centre, lamp.radius_px, c) for p, c in planes])


def _taken(
    bundle: Bundle, seed: int, *, plate: bool = True, exposure: float = 1.0
) -> SimulationOptions:
    depth_mm = bundle.reference_depth_mm
    return SimulationOptions(seed=seed, depth_mm=depth_mm, plate=plate, exposure=exposure)


def merged(shots: Sequence[Simulation], bundle: Bundle) -> FloatArray:
    """Merge a bracket as `camkit merge` does; 1.0 is the white of the longest frame."""
    sensor = bundle.manifest.sensor
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, f"{n}.dng") for n in range(len(shots))]
        for file, shot in zip(files, shots, strict=True):
            write_capture(file, shot, sensor, bundle.manifest.name)
        out = Path(folder, "merged.exr")
        merge_to_exr(survey(files, TIMES), out, response=None, reference=files[0].name)
        return read_light(out)


def _restoring(bundle: Bundle, sizes: Sequence[str]) -> dict[str, Pipeline]:
    """Return the ways in which a bundle restores."""
    options = Options(threads=1, **in_sensor_geometry(bundle.manifest))
    ways = {"physics": replace(options, method="physics")}
    ways |= {size: replace(options, size=size) for size in sizes}
    return {name: Pipeline(bundle, way) for name, way in ways.items()}


def mean_of(scenes: Sequence[Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Return the means over scenes, and in how many a way ends above the bracket (`wins`)."""
    found: dict[str, dict[str, float]] = {}
    for way in scenes[0]:
        own = [scene[way] for scene in scenes]
        found[way] = {
            key: round(float(np.mean([one[key] for one in own if key in one])), 2)
            for key in KEPT
            if any(key in one for one in own)
        }
        ahead = [s[way]["hdr_psnr_db"] > s[BRACKET]["hdr_psnr_db"] for s in scenes]
        found[way]["wins"] = sum(ahead)
    return found


def to_text(means: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Return the table of the means."""
    ways = list(next(iter(means.values())))
    head = ["lamps", *(f"{way}: dB, stops" for way in ways), "above the bracket"]
    rows = [
        [
            name,
            *(f"{way['hdr_psnr_db']:.1f}, {way.get('stops_rmse', 0):.1f}" for way in own.values()),
            ", ".join(
                f"{name} {way['wins']}" for name, way in own.items() if name not in (INPUT, BRACKET)
            ),
        ]
        for name, own in means.items()
    ]
    return table(head, rows)


if __name__ == "__main__":
    main()
