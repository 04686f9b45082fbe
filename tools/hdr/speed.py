r"""CPU-seconds against what clipped: whole captures, restored and only developed, by stage.

    python -m tools.hdr.speed --bundle streak-hdr -o docs/results/hdr-speed.json

Captures are made first (`speed_captures`): nothing clipped, 50 lamps of 20 px, shares of the scene
above white, and a crop of 512 px. Each is processed with one thread in a process of its own, by
physics (and the networks of `--sizes`) and by `--method develop`, in turns, `--runs` times; medians
are given. Seconds are of the processor, from file to file, without the start of the process. The
chart lies beside the JSON.
"""

import argparse
import json
import statistics
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.bundle.reader import Bundle
from camkit.report.figure import GRID_COLOR, MARKS, field_color, new_figure, to_png
from camkit.runtime.plan.decision import DEVELOP
from tools.hdr.record import in_one_line, new_parser, open_camera, origin_of, table, write_record
from tools.hdr.speed_captures import SUBJECTS, Subject, write_subject
from tools.stage_profile import run_again

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RUNS: Final = 3
NET: Final = "net"
MOST_PEAK_MB: Final = 1000.0
OVER: Final = "over_development_s"
ALL: Final = "cpu_s"
CROPS: Final = tuple(subject.name for subject in SUBJECTS if subject.side_px is not None)
GOALS: Final = {
    "nothing": (OVER, 1.5),
    "50 lamps": ("over_nothing_s", 2.0),
    "1.5 %": (OVER, 30.0),
    "512 px, 1.5 %": (ALL, 0.8),
}
"""Subject -> what is limited, CPU-seconds; peak memory is limited for all."""


@in_one_line
def main() -> None:
    """Print a table, draw the chart."""
    parser = new_parser(__doc__)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--subjects", nargs="+", choices=[s.name for s in SUBJECTS])
    arguments = parser.parse_args()
    bundle = open_camera(arguments.bundle, arguments.sizes)
    chosen = [s for s in SUBJECTS if s.name in (arguments.subjects or [s.name])]
    with tempfile.TemporaryDirectory() as folder:
        rows = measure(bundle, arguments.sizes, chosen, Path(folder), runs=arguments.runs)
    origin = origin_of(bundle, arguments.sizes)
    record = {**origin, "runs": arguments.runs, "goals": GOALS, "rows": rows}
    print(to_text(rows))
    write_record(arguments.output, record)
    if arguments.output is not None:
        arguments.output.with_suffix(".png").write_bytes(to_png(draw(rows)))


def measure(
    bundle: Bundle, sizes: Sequence[str], subjects: Sequence[Subject], folder: Path, *, runs: int
) -> list[dict[str, Any]]:
    """Time every subject; one row for each and method."""
    clipped = {
        subject.name: write_subject(folder / f"{number}.dng", subject, bundle)
        for number, subject in enumerate(subjects)
    }
    ways = {DEVELOP: None, "physics": None, **{size: size for size in sizes}}
    seen: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for _ in range(runs):
        for number, subject in enumerate(subjects):
            for way, size in ways.items():
                found = profiled(folder / f"{number}.dng", bundle, way, size)
                seen[subject.name, way].append(found)
    rows = []
    for subject in subjects:
        developed = _median(seen[subject.name, DEVELOP])
        for way in ways:
            row = {"subject": subject.name, "share": subject.share, "method": way}
            row["saturated_fraction"] = round(clipped[subject.name], 6)
            own = _median(seen[subject.name, way])
            row |= own | {OVER: round(own[ALL] - developed[ALL], 3)}
            rows.append(row)
    return _beside_nothing(rows)


def profiled(capture: Path, bundle: Bundle, way: str, size: str | None) -> dict[str, Any]:
    """Process a capture once in a process of its own, with one thread."""
    told = run_again(
        argparse.Namespace(
            capture=capture,
            bundle=str(bundle.path),
            size=size,
            format="exr",
            method=NET if size else way,
            threads=1,
        )
    )
    found: dict[str, Any] = json.loads(told)
    return found


def _median(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    stages = {
        name: round(statistics.median(run["cpu"].get(name, 0.0) for run in runs), 3)
        for name in runs[0]["cpu"]
    }
    every = [sum(run["cpu"].values()) for run in runs]
    return {
        ALL: round(statistics.median(every), 3),
        "cpu_s_runs": [round(one, 3) for one in every],
        "process_cpu_s": round(statistics.median(r["total"]["process CPU"] for r in runs), 3),
        "peak_mb": round(max(run["total"]["peak MB"] for run in runs), 1),
        "stages_cpu_s": stages,
    }


def _beside_nothing(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Add what a whole capture takes beyond one of which nothing clipped, by the same method."""
    least = {row["method"]: row[OVER] for row in rows if row["subject"] == "nothing"}
    for row in rows:
        if row["method"] in least and row["subject"] not in CROPS:
            row["over_nothing_s"] = round(row[OVER] - least[row["method"]], 3)
    return rows


def to_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table with the goals."""
    head = ["clipped", "method", "CPU s", "over development", "goal", "highlights", "network"]
    lines = []
    for row in rows:
        goal = ""
        if row["method"] != DEVELOP and row["subject"] in GOALS:
            key, most = GOALS[row["subject"]]
            if key in row:
                goal = f"{row[key]:.1f} of {most:g} {'kept' if row[key] <= most else 'missed'}"
        stages = (row["stages_cpu_s"].get(name, 0.0) for name in ("highlights", "network"))
        memory = f"{row['peak_mb']:.0f}{'' if row['peak_mb'] <= MOST_PEAK_MB else ' missed'}"
        cells = (row["subject"], row["method"], row[ALL], row[OVER], goal, *stages, memory)
        lines.append(cells)
    return table([*head, "peak MB"], lines)


def draw(rows: Sequence[Mapping[str, Any]]) -> "Figure":
    """Draw seconds over development against the share of the scene above white."""
    figure = new_figure(6, 3.7)
    panel = figure.subplots()
    shown = [subject.name for subject in SUBJECTS if not (subject.lamps or subject.side_px)]
    whole = [row for row in rows if row["subject"] in shown]
    methods = [m for m in dict.fromkeys(row["method"] for row in whole) if m != DEVELOP]
    for number, method in enumerate(methods):
        own = [row for row in whole if row["method"] == method]
        places = [100 * row["share"] for row in own]
        seconds = [row[OVER] for row in own]
        color, mark = field_color(number), MARKS[number % len(MARKS)]
        panel.plot(places, seconds, f"{mark}-", color=color, label=method)
    shares = {row["subject"]: 100 * row["share"] for row in whole}
    for name, (key, most) in GOALS.items():
        if key == OVER and name in shares:
            panel.plot([shares[name]], [most], "v", color="0.5")
            panel.annotate("goal", (shares[name], most), (5, 3), textcoords="offset points")
    panel.set_xlabel("scene above white, %")
    panel.set_ylabel("CPU-seconds over development, 24 MP")
    panel.set_ylim(bottom=0)
    panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    panel.legend(fontsize=8, frameon=False)
    return figure


if __name__ == "__main__":
    main()
