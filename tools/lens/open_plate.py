"""What the open plate buys: it and the same plate behind a real stop, by exposure time and length.

    python -m tools.lens.open_plate --bundle open.camkit --stop stop.camkit --data PICTURE -o DIR

Both photograph the same pictures, from the middle of the sensor to its corner, for equal times; the
stop gets the share of the light that it passes. The ISO is what the exposure needs, up to 6400:
where light lacks, noise grows; where pixels would overflow, the shutter closes earlier and more
time is of no use. A camera is a bundle, or whatever else `camkit analyse field` knows by a name;
one with a network has a curve of it besides.

`--stops-mm` moves the stop nearer to the plate, which makes the camera shorter; every such camera
is frozen afresh and restored, as the open plate beside it, by the filter of each colour for itself.

Writes open-plate.png and open-plate.json into DIR.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import torch

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor
from camkit.contracts import FloatArray
from camkit.errors import UnsupportedError
from camkit.models_def.optics.frozen import corner_height_mm
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.freezing import HazyGrid, freeze_hazy
from camkit.report.analysis.physical import write_camera
from camkit.report.analysis.recovery import filled, zones_of
from camkit.report.figure import GRID_COLOR, MARKS, field_color, new_figure, to_png
from camkit.report.quality import BORDER_PX, read_picture
from camkit.runtime.twin.light import Light
from camkit.runtime.twin.truth import light_sensor
from tools.hdr.record import in_one_line
from tools.lens.cameras import (
    Way,
    decibels,
    light_through,
    open_camera,
    optics_of,
    passed_light,
    restored,
    setting_of,
    square_error,
    truth_of,
    ways_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FRAME_PX: Final = (3000, 2000)
TIMES: Final = (1 / 256, 1 / 64, 1 / 16, 1 / 4, 1.0, 4.0, 16.0)
"""Of the time in which white fills the pixels behind the open plate at ISO 100."""
LENGTH_TIMES: Final = (1 / 64, 1.0)
RINGS: Final = 4
FREEZE_FIELDS: Final = 9
FREEZE_RAYS: Final = 6000
OPEN: Final = "open"
STOP: Final = "stop"


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One picture by one camera.

    Attributes:
        camera: `open` or `stop`.
        length_mm: From its first surface to the sensor.
        way: What restored it.
        picture: Name of the file.
        time: Of the exposure, 1 where white fills the pixels of the open plate at ISO 100.
        iso: Which that needed.
        pushed: By what the picture was made brighter in the end.
        psnr_db: Of sRGB, over the frame.
        rings_db: The same from the axis to the corner.
    """

    camera: str
    length_mm: float
    way: Way
    picture: str
    time: float
    iso: float
    pushed: float
    psnr_db: float
    rings_db: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """A camera in the comparison.

    Attributes:
        name: `open` or `stop`.
        bundle: It.
        light: That it gets, 1 for the open plate.
        length_mm: See `Point`.
    """

    name: str
    bundle: Bundle
    light: float
    length_mm: float


@in_one_line
def main() -> None:
    """Photograph, restore, draw, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", required=True, help="the camera of the open plate")
    parser.add_argument("--stop", required=True, help="that of the plate behind its stop")
    parser.add_argument("--lens", type=Path, default=Path("thin-plate"), help="of the open plate")
    parser.add_argument("--stop-lens", type=Path, default=Path("thin-plate-stop"))
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="pictures")
    parser.add_argument("--frame", type=int, nargs=2, metavar=("W", "H"), default=FRAME_PX)
    parser.add_argument("--times", type=float, nargs="+", default=TIMES)
    parser.add_argument(
        "--stops-mm", type=float, nargs="*", default=(), help="distances of the stop, for length"
    )
    parser.add_argument("-o", "--out-dir", type=Path, required=True)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    lens, stopped = read_lens(chosen.lens), read_lens(chosen.stop_lens)
    share = passed_light(stopped) / passed_light(lens)
    pictures = {path.name: filled(read_picture(path), *chosen.frame) for path in chosen.data}
    with TemporaryDirectory() as folder:
        near = Path(folder)
        pair = [
            Subject(
                name=name,
                bundle=open_camera(asked, near / name),
                light=light,
                length_mm=length_mm(one),
            )
            for name, asked, one, light in (
                (OPEN, chosen.bundle, lens, 1.0),
                (STOP, chosen.stop, stopped, share),
            )
        ]
        points = [p for s in pair for p in measure(s, pictures, chosen.times)]
        moved = shorter(pair[0], stopped, share, chosen.stops_mm, near) if chosen.stops_mm else []
        first = dict(list(pictures.items())[:1])
        by_length = [p for s in moved for p in measure(s, first, LENGTH_TIMES)]
    told = {
        "frame_px": list(chosen.frame),
        "stop_light": round(share, 5),
        "length_mm": {s.name: round(s.length_mm, 2) for s in pair},
        "points": [asdict(p) for p in points],
        "by_length": [asdict(p) for p in by_length],
        "stop_needs_times": waits(points),
    }
    chosen.out_dir.mkdir(parents=True, exist_ok=True)
    (chosen.out_dir / "open-plate.json").write_text(json.dumps(told, indent=1) + "\n", "utf-8")
    (chosen.out_dir / "open-plate.png").write_bytes(to_png(draw(points, by_length)))
    print(to_text(points, by_length))


def length_mm(lens: Lens) -> float:
    """Return the length from the first surface, which may be a stop, to the sensor."""
    return sum(surface.thickness_mm for surface in lens.surfaces)


def with_stop_at(lens: Lens, distance_mm: float) -> Lens:
    """Return a lens whose first surface is a stop, with the stop at another distance."""
    stop, *rest = lens.surfaces
    return replace(lens, surfaces=(replace(stop, thickness_mm=distance_mm), *rest))


def shorter(
    open_: Subject, stopped: Lens, light: float, distances_mm: Sequence[float], folder: Path
) -> list[Subject]:
    """Return the open plate and cameras whose stop stands at other distances, all of one filter."""
    sensor = light_sensor(open_.bundle.manifest)
    if not isinstance(sensor, BayerSensor):
        raise UnsupportedError("the stop is moved before a Bayer sensor only")

    def camera(name: str, optics: FrozenOptics) -> Bundle:
        return write_camera(folder / f"{name}.camkit", name, optics, sensor)

    found = [replace(open_, bundle=camera("plain-open", optics_of(open_.bundle)))]
    for number, distance in enumerate(distances_mm):
        lens = with_stop_at(stopped, distance)
        optics, _ = freeze_hazy(lens, sensor, HazyGrid(fields=FREEZE_FIELDS, rays=FREEZE_RAYS))
        bundle = camera(f"plain-stop-{number}", optics)
        found.append(Subject(name=STOP, bundle=bundle, light=light, length_mm=length_mm(lens)))
    return found


def measure(
    subject: Subject, pictures: dict[str, FloatArray], times: Sequence[float]
) -> list[Point]:
    """Photograph pictures with a camera for several times, and restore them."""
    found = []
    for number, (name, picture) in enumerate(pictures.items()):
        light = light_through(subject.bundle, picture, 1.0)
        truth = truth_of(subject.bundle, light)
        ring = rings(subject.bundle, light)
        known: dict[tuple[float, Way], FloatArray] = {}
        for time in times:
            exposure = min(time * subject.light, 1.0)
            setting = setting_of(exposure)
            for way in ways_of(subject.bundle):
                if (exposure, way) not in known:
                    shown = restored(subject.bundle, light, exposure, way, seed=number)
                    known[exposure, way] = square_error(shown, truth)
                square = known[exposure, way]
                point = Point(
                    camera=subject.name,
                    length_mm=round(subject.length_mm, 2),
                    way=way,
                    picture=name,
                    time=time,
                    iso=round(setting.iso, 1),
                    pushed=round(1 / setting.exposure, 3),
                    psnr_db=round(decibels(square), 3),
                    rings_db=tuple(
                        round(decibels(square[ring == k]), 3)
                        for k in range(RINGS)
                        if (ring == k).any()
                    ),
                )
                found.append(point)
                print(_line(point), flush=True)
    return found


def rings(bundle: Bundle, light: Light) -> Any:
    """Return the number of the ring (h, w) of every pixel but those of the border."""
    middles = (np.arange(RINGS) + 0.5) / RINGS * corner_height_mm(light_sensor(bundle.manifest))
    return zones_of(light.window, 1, middles)[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]


def waits(points: Sequence[Point]) -> dict[str, float | None]:
    """Give, by time of the open plate, what times as long the stop takes to be as good.

    By the mean of all pictures, of the filter alone, between the times linear in the logarithm;
    None where the stop is better already for the shortest time, or never as good.
    """
    of = {name: _means(points, name, "filter") for name in (OPEN, STOP)}
    at = np.log2(sorted(of[STOP]))
    level = np.maximum.accumulate([of[STOP][time] for time in sorted(of[STOP])])
    found: dict[str, float | None] = {}
    for time, wanted in sorted(of[OPEN].items()):
        inside = level[0] <= wanted <= level[-1]
        needed = 2.0 ** float(np.interp(wanted, level, at))
        found[f"{time:g}"] = round(needed / time, 3) if inside else None
    return found


def _means(points: Sequence[Point], camera: str, way: Way) -> dict[float, float]:
    """Return the mean over pictures by time."""
    groups: dict[float, list[float]] = {}
    for p in points:
        if (p.camera, p.way) == (camera, way):
            groups.setdefault(p.time, []).append(p.psnr_db)
    return {time: float(np.mean(found)) for time, found in groups.items()}


def draw(points: Sequence[Point], by_length: Sequence[Point]) -> "Figure":
    """Draw dB over exposure time, and over length where stops were moved."""
    figure = new_figure(8.2 if by_length else 4.6, 3.5)
    panels = figure.subplots(1, 2 if by_length else 1, squeeze=False, sharey=True)[0]
    _draw_times(panels[0], points)
    if by_length:
        _draw_lengths(panels[1], by_length)
    panels[0].set_ylabel("PSNR, dB of sRGB", fontsize=8)
    for panel in panels:
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
        panel.tick_params(labelsize=7)
        panel.legend(fontsize=7, frameon=False)
    return figure


def _draw_times(panel: "Axes", points: Sequence[Point]) -> None:
    labels = {OPEN: "open plate", STOP: "behind the stop"}
    for number, camera in enumerate((OPEN, STOP)):
        for way, style in (("filter", "-"), ("network", "--")):
            chosen = [p for p in points if (p.camera, p.way) == (camera, way)]
            if not chosen:
                continue
            for name in dict.fromkeys(p.picture for p in chosen):
                own = [p for p in chosen if p.picture == name]
                at, db = [p.time for p in own], [p.psnr_db for p in own]
                panel.plot(at, db, style, color=field_color(2 * number), linewidth=0.6, alpha=0.5)
            means = _means(points, camera, way)  # type: ignore[arg-type]
            panel.plot(
                list(means),
                list(means.values()),
                style,
                color=field_color(2 * number),
                marker=MARKS[number],
                markersize=4,
                label=f"{labels[camera]}, {way}",
            )
    panel.set_xscale("log", base=2)
    panel.set_xlabel("exposure time (1: the open plate fills its pixels at ISO 100)", fontsize=8)
    panel.set_title("thin: by picture; thick: the mean", fontsize=8)


def _draw_lengths(panel: "Axes", points: Sequence[Point]) -> None:
    for number, time in enumerate(dict.fromkeys(p.time for p in points)):
        color = field_color(number)
        for camera, style in ((OPEN, "*"), (STOP, "-o")):
            own = [p for p in points if (p.time, p.camera) == (time, camera)]
            panel.plot(
                [p.length_mm for p in own],
                [p.psnr_db for p in own],
                style,
                color=color,
                markersize=11 if camera == OPEN else 4,
                label=f"{'open' if camera == OPEN else 'stop'}, time {time:g}",
            )
    panel.set_xlabel("length from stop or plate to sensor, mm", fontsize=8)
    panel.set_title("the stop moved towards the plate; one picture, plain filter", fontsize=8)


def to_text(points: Sequence[Point], by_length: Sequence[Point]) -> str:
    """Return the means by time, and what shorter cameras reach, as tables in Markdown."""
    lines = ["| time | open, filter | stop, filter | difference |", "|---|---|---|---|"]
    of = {name: _means(points, name, "filter") for name in (OPEN, STOP)}
    for time in sorted(of[OPEN]):
        one, other = of[OPEN][time], of[STOP][time]
        lines.append(f"| {time:g} | {one:.2f} | {other:.2f} | {other - one:+.2f} |")
    if by_length:
        lines += ["", "| camera | length, mm | time | dB | rings |", "|---|---|---|---|---|"]
        lines += [
            f"| {p.camera} | {p.length_mm:.1f} | {p.time:g} | {p.psnr_db:.2f} "
            f"| {' '.join(f'{v:.1f}' for v in p.rings_db)} |"
            for p in by_length
        ]
    return "\n".join(lines)


def _line(p: Point) -> str:
    said = f"{p.camera} {p.length_mm:.1f} mm, {p.way}, {p.picture}, time {p.time:g}, ISO {p.iso:g}"
    return f"{said}: {p.psnr_db:.2f} ({' '.join(f'{v:.1f}' for v in p.rings_db)})"


if __name__ == "__main__":
    main()
