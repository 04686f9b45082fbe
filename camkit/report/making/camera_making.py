"""A lens and a sensor to a proved bundle: `camkit.make` and `camkit make`.

    described, frozen, filtered -> OUT, usable   (about two minutes)
    fitted -> OUT anew
    trained for what is left of the minutes, exported, judged -> OUT, if it beats its filter
    page

Minutes are those of the CPU, and count everything but the page.
"""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.reader import Bundle, open_bundle
from camkit.caller import command_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.models_def.face.recipe_writing import CameraWords
from camkit.models_def.face.torch_need import require_torch
from camkit.progress import working
from camkit.report.making.camera_judging import FILTER, Judgement, best_size, judge_camera
from camkit.report.making.camera_page import MadeCamera, camera_html
from camkit.report.making.camera_steps import (
    FILTER_BUNDLE,
    LENS,
    NETWORK_BUNDLE,
    CameraSteps,
    CameraWish,
)
from camkit.report.making.page_parts import layout_of, pictures_of, seconds_of
from camkit.report.making.work_folder import WorkFolder
from camkit.runtime.files.in_memory import FilePath, optional_path
from camkit.runtime.output.part_file import refuse_existing, write_together
from camkit.stopwatch import Stopwatch

WORK_SUFFIX: Final = ".work"
PAGE_SUFFIX: Final = ".html"
START: Final = "duet"
LEAST_FIT_S: Final = 240.0
"""Left of the minutes, from which fitting the bank leaves something to train with."""
LAST_S: Final = 75.0
"""Kept for export and judging."""
LEAST_TRAINING_S: Final = 60.0

Tell = Callable[[str], object]


@checked
def make(
    optics: FilePath,
    out: FilePath,
    *,
    camera: CameraWords,
    minutes: float = 15.0,
    size: str = "S",
    name: str | None = None,
    data: FilePath | None = None,
    valid: FilePath | None = None,
    start: FilePath = START,
    work_dir: FilePath | None = None,
    workers: int = 1,
    overwrite: bool = False,
    on_note: Callable[[str], object] | None = None,
    stopwatch: Stopwatch | None = None,
) -> dict[str, Any]:
    """Make a camera: from a lens or a measured PSF to a bundle that passes its checks.

    `out` is usable as soon as its filter is written, and replaced by better ones. Interrupted, a
    call with the same words goes on where it was.

    Args:
        optics: Lens file (.toml, .zmx), name of a built-in lens, or measured PSF (.safetensors of
            `camkit.calibrate`'s import).
        out: Bundle to write (.camkit); the page lies beside it (.html).
        camera: Its sensor and how the lens is used.
        minutes: Of the CPU, everything counted; 0 for the filter alone.
        size: Of the network, "S" or "M".
        name: Of the camera; None for that of the file `out`.
        data: Folder of pictures to train on; None for procedural scenes.
        valid: Folder of pictures to choose and judge by; None likewise.
        start: Bundle or checkpoint with the first weights.
        work_dir: Folder of the steps; None for NAME.work beside `out`.
        workers: Processes that make samples.
        overwrite: Whether `out` and the work of an earlier call are replaced.
        on_note: Called with a line when a step is done.
        stopwatch: Counts the minutes; None begins now.

    Returns:
        The files, decibels of every method with their gains, and the CPU-seconds of every step.

    Raises:
        ContractError: If a word is wrong, or files exist that other words made.
        UnsupportedError: If torch is not installed, or the lens holds what camkit does not trace.
    """
    require_torch(command_text("make"))
    path = Path(out)
    work_path = path.with_suffix(WORK_SUFFIX) if work_dir is None else Path(work_dir)
    if minutes < 0:
        raise ContractError(f"minutes must be >= 0; got {minutes:g}")
    if overwrite:
        shutil.rmtree(work_path, ignore_errors=True)
    elif not work_path.is_dir():
        refuse_existing((path, path.with_suffix(PAGE_SUFFIX)), overwrite=False)
    wish = CameraWish(
        optics=Path(optics),
        camera=camera,
        name=name or path.stem,
        size=size,
        start=Path(start),
        data=optional_path(data),
        valid=optional_path(valid),
        workers=workers,
        minutes=minutes,
    )
    work = WorkFolder(work_path, wish.to_json(), stopwatch or Stopwatch())
    return _Making(CameraSteps(wish=wish, work=work), path, on_note or _ignore).run()


class _Making:
    """The steps of a camera in their order."""

    def __init__(self, steps: CameraSteps, out: Path, tell: Tell) -> None:
        self._steps, self._out, self._tell = steps, out, tell
        self._work, self._wish = steps.work, steps.wish

    def run(self) -> dict[str, Any]:
        """Make the camera; return what is known of it."""
        steps, work = self._steps, self._work
        facts = work.step("described", steps.describe)
        for text in facts["notes"]:
            self._tell(text)
        if not self._wish.is_measured:
            frozen = work.step("frozen", steps.freeze)
            self._tell(f"kernels of {frozen['side_px']} px hold {frozen['energy_kept']:.1%}")
        work.step("filtered", steps.export_filter)
        self._ship(FILTER_BUNDLE, "its filter restores, usable now")
        is_grey = facts["channels"] == 1
        if not is_grey and (self._left_s() > LEAST_FIT_S or work.is_done("fitted")):
            fitted = work.step("fitted", steps.fit_bank)
            self._ship(FILTER_BUNDLE, f"colours restored together: {fitted['gain_db']:+.2f} dB")
        if is_grey and self._wish.minutes:
            self._tell("networks are trained on three colours; a grey camera has its filter alone")
        judged = self._judged(FILTER_BUNDLE) if is_grey else self._with_network()
        bundle = open_bundle(self._out)
        page = self._out.with_suffix(PAGE_SUFFIX)
        write_together({page: self._page(bundle, judged).encode()})
        return self._result(bundle, judged, page)

    def _left_s(self) -> float:
        return 60 * self._wish.minutes - self._work.spent_s()

    def _with_network(self) -> Mapping[str, Judgement]:
        """Train a network if minutes are left, and ship it if it beats the filter."""
        steps, work = self._steps, self._work
        training_s = self._left_s() - LAST_S
        if training_s < LEAST_TRAINING_S and not work.is_done("trained"):
            if self._wish.minutes:
                self._tell("no minutes are left to train a network")
            return self._judged(FILTER_BUNDLE)
        trained = work.step("trained", lambda: steps.train(training_s / 60))
        self._tell(f"network {self._wish.size}: {trained['steps']} steps")
        work.step("exported", steps.export_network)
        judged = self._judged(NETWORK_BUNDLE)
        size = self._wish.size
        gain_db, error_db = judged[size].gain_over(judged[FILTER])
        line = f"network {size}: {gain_db:+.2f} +- {error_db:.2f} dB over the filter"
        if best_size(judged, [size]) is None:
            self._tell(f"{line}: it stays out of the bundle; train for more minutes")
        else:
            self._ship(NETWORK_BUNDLE, line)
        return judged

    @working("judging the camera")
    def _judged(self, name: str) -> Mapping[str, Judgement]:
        bundle = open_bundle(self._work.path(name))
        return judge_camera(bundle, self._wish.valid, self._work.folder)

    def _ship(self, name: str, line: str) -> None:
        self._steps.ship(name, self._out)
        self._tell(f"{self._out}: {line} ({self._work.spent_s():.0f} CPU-s so far)")

    def _page(self, bundle: Bundle, judged: Mapping[str, Judgement]) -> str:
        return camera_html(
            MadeCamera(
                bundle=bundle,
                facts=self._work.step("described", self._steps.describe),
                judged=judged,
                pictures=pictures_of(bundle, self._wish.valid, self._work.folder),
                seconds=seconds_of(bundle),
                steps=self._work.seconds(),
                layout=None if self._wish.is_measured else layout_of(self._work.path(LENS)),
            )
        )

    def _result(
        self, bundle: Bundle, judged: Mapping[str, Judgement], page: Path
    ) -> dict[str, Any]:
        return {
            "bundle": str(self._out),
            "page": str(page),
            "sizes": list(bundle.manifest.sizes),
            "psnr_db": {m: round(float(np.mean(j.psnr_db)), 3) for m, j in judged.items()},
            "over_filter_db": {
                m: [round(v, 3) for v in j.gain_over(judged[FILTER])]
                for m, j in judged.items()
                if m != FILTER
            },
            "cpu_s": self._work.seconds(),
        }


def _ignore(_text: str) -> None:
    """Drop a note."""
