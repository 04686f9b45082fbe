"""Savings and losses of `--quality adaptive` against `exact`, scene by scene."""

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Wiener
from camkit.report.figure import new_figure, to_png, to_svg
from camkit.runtime.bank.blocks import lay_spans
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.options import Options, Quality
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.estimate import network_seconds
from camkit.runtime.plan.idle_blocks import plain_share
from camkit.runtime.plan.rules.size import REFERENCE
from camkit.runtime.plan.speed import Speed
from camkit.runtime.twin.simulate import Simulation
from tools.plan.cells import cell_errors, photograph, sharp_of, start
from tools.plan.scenes import ProofScene
from tools.tables.records import markdown_table

ISOS: Final = (100.0, 800.0)
STAGES: Final = ("wiener", "network")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProofRow:
    """One capture.

    Attributes:
        kind: Subject of the scene; the name is that of plan.json.
        name: Of the scene.
        iso: Sensitivity.
        loss_db: PSNR of exact minus PSNR of the quality, on sRGB values in sensor geometry.
        exact_db: PSNR of exact.
        saved_work: Share of the time of bank and networks saved, from counted blocks and windows
            and the measured speed of this machine: free of the noise of other processes.
        saved_seconds: The same from the clocks of both runs.
        saved_cpu: Share of the CPU seconds of everything saved.
        choice: What the cells got.
    """

    kind: str
    name: str
    iso: float
    loss_db: float
    exact_db: float
    saved_work: float
    saved_seconds: float
    saved_cpu: float
    choice: str

    def line(self) -> str:
        """Return the row for people."""
        return (
            f"{self.kind:8s} {self.name[:34]:34s} ISO {self.iso:4g}: loses {self.loss_db:6.3f} dB "
            f"of {self.exact_db:5.2f}, saves {self.saved_work:5.1%} of network and FFT "
            f"(clock {self.saved_seconds:5.1%}, all CPU {self.saved_cpu:5.1%}); {self.choice}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    image: FloatArray
    work: Reconstruction
    cpu_s: float

    @property
    def seconds(self) -> float:
        return sum(self.work.seconds.get(stage, 0.0) for stage in STAGES)


def prove(
    bundle: Bundle, scenes: Iterator[ProofScene], *, quality: Quality = "adaptive", runs: int = 1
) -> Iterator[ProofRow]:
    """Measure every scene at one ISO, alternating from scene to scene.

    Args:
        bundle: A calibrated camera.
        scenes: From `tools.plan.scenes.proof_scenes`.
        quality: Compared with exact.
        runs: Interleaved timed runs of both; medians are taken.
    """
    exact = Pipeline(bundle, Options(undistort=False, threads=1, size=None))
    other = Pipeline(bundle, Options(undistort=False, threads=1, quality=quality))
    for number, scene in enumerate(scenes):
        simulation = photograph(bundle, scene.make(), number=number, iso=ISOS[number % len(ISOS)])
        pairs = [(_run(exact, simulation), _run(other, simulation)) for _ in range(runs)]
        yield _row(bundle, scene, simulation, pairs)


def _run(pipeline: Pipeline, simulation: Simulation) -> _Run:
    began = time.process_time()
    work = start(pipeline, simulation)
    image = work.fill(None)
    return _Run(image=image, work=work, cpu_s=time.process_time() - began)


def _row(
    bundle: Bundle, scene: ProofScene, simulation: Simulation, pairs: Sequence[tuple[_Run, _Run]]
) -> ProofRow:
    first, second = pairs[0]
    sharp = sharp_of(simulation, bundle)
    errors = [float(cell_errors(run.image, sharp).sum()) for run in (first, second)]
    pixels = (sharp.shape[1] - 64) * (sharp.shape[2] - 64)
    ratios = [(b.seconds / a.seconds, b.cpu_s / a.cpu_s) for a, b in pairs]
    seconds, cpu = np.median(np.array(ratios), axis=0)
    speed = first.work.measured_speed(bundle.manifest.sizes)
    works = [_counted_seconds(bundle, run.work, speed) for run in (first, second)]
    choices = {d["what"]: d["choice"] for d in second.work.record["decisions"]}
    return ProofRow(
        kind=scene.subject,
        name=scene.name,
        iso=simulation.iso,
        loss_db=10 * np.log10(errors[1] / errors[0]),
        exact_db=-10 * np.log10(errors[0] / pixels),
        saved_work=1 - works[1] / works[0],
        saved_seconds=float(1 - seconds),
        saved_cpu=float(1 - cpu),
        choice=choices.get("cells", ""),
    )


def _counted_seconds(bundle: Bundle, work: Reconstruction, speed: Speed) -> float:
    """Return the seconds of blocks and windows as planned, at the speed of this machine."""
    stage = bundle.manifest.stage(Wiener)
    megapixels = work.capture.height * work.capture.width / 1e6
    seconds = sum(
        network_seconds(role, windows.window_mp(), speed, megapixels)
        for role, windows in work.windows.items()
    )
    if stage is not None:
        rows, columns = (
            lay_spans(side, stage.block_px, stage.overlap_px)
            for side in (work.capture.height, work.capture.width)
        )
        share = 0.0
        if work.labels is not None:
            halo_px = max((windows.halo_px for windows in work.windows.values()), default=0)
            share = plain_share(work.labels, halo_px, rows, columns)
        seconds += (1 - share) * len(rows) * len(columns) * speed.block_s
    return seconds


def summarise(rows: Sequence[ProofRow]) -> dict[str, dict[str, float]]:
    """Return per subject and for all: captures, mean and worst loss, mean savings."""
    subjects = list(dict.fromkeys(row.kind for row in rows))
    groups = {name: [row for row in rows if row.kind == name] for name in subjects}
    groups["all"] = list(rows)
    return {
        name: {
            "captures": len(group),
            "mean_loss_db": float(np.mean([r.loss_db for r in group])),
            "worst_loss_db": float(max(r.loss_db for r in group)),
            "saved_work": float(np.mean([r.saved_work for r in group])),
            "saved_seconds": float(np.mean([r.saved_seconds for r in group])),
            "saved_cpu": float(np.mean([r.saved_cpu for r in group])),
        }
        for name, group in groups.items()
    }


def write_report(rows: Sequence[ProofRow], bundle: Bundle, folder: Path) -> list[str]:
    """Write plan.json, plan.png and plan.svg; give a table in Markdown as lines."""
    folder.mkdir(parents=True, exist_ok=True)
    summary = summarise(rows)
    record: dict[str, Any] = {
        "bundle": bundle.manifest.name,
        "bundle_sha256": bundle.sha256,
        "reference": REFERENCE,
        "summary": summary,
        "rows": [asdict(row) for row in rows],
    }
    (folder / "plan.json").write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    _chart(rows, folder)
    heads = ["kind", "captures", "mean loss", "worst loss", "network + FFT saved", "by the clock"]
    cells = [
        [
            name,
            f"{means['captures']:.0f}",
            f"{means['mean_loss_db']:.3f} dB",
            f"{means['worst_loss_db']:.3f} dB",
            f"{means['saved_work']:.0%}",
            f"{means['saved_seconds']:.0%}",
        ]
        for name, means in summary.items()
    ]
    return markdown_table(heads, cells).splitlines()


def _chart(rows: Sequence[ProofRow], folder: Path) -> None:
    """Draw saving against loss, a colour per subject, with the limits of the loss."""
    figure = new_figure(7, 4.5)
    axes = figure.subplots()
    for subject in dict.fromkeys(row.kind for row in rows):
        group = [row for row in rows if row.kind == subject]
        axes.scatter([r.loss_db for r in group], [100 * r.saved_work for r in group], label=subject)
    axes.axvline(0.1, color="0.6", linestyle="--", linewidth=1, label="0.1 dB: limit of the mean")
    axes.axvline(0.3, color="0.3", linestyle=":", linewidth=1, label="0.3 dB: limit of each")
    axes.axhline(40, color="0.8", linewidth=1)
    axes.set_xlabel("loss against exact in dB")
    axes.set_ylabel("network + FFT time saved in %")
    axes.set_title("adaptive against exact, one point per capture")
    axes.legend(fontsize="small")
    (folder / "plan.png").write_bytes(to_png(figure))
    (folder / "plan.svg").write_text(to_svg(figure), encoding="utf-8")
