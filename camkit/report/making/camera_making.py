"""A lens and a sensor to a proved bundle: `camkit.make` and `camkit make`.

Minutes are those of the CPU, and count everything but the page.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from camkit.caller import command_text, option_text
from camkit.entry_points import JUDGE
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.models_def.face.recipe_writing import CameraWords
from camkit.models_def.face.torch_need import require_torch
from camkit.report.making.work_folder import WorkFolder, remove_work
from camkit.runtime.files.in_memory import FilePath, optional_path
from camkit.runtime.output.part_file import refuse_existing
from camkit.stopwatch import Stopwatch

WORK_SUFFIX: Final = ".work"
PAGE_SUFFIX: Final = ".html"
START: Final = "duet"


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
    judge: bool = True,
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
        judge: Whether the camera is judged on captures and gets a page; needed by a network.
        overwrite: Whether `out` and the work of an earlier call are replaced.
        on_note: Called with a line when a step is done.
        stopwatch: Counts the minutes; None begins now.

    Returns:
        The files, decibels of every method with their gains, and the CPU-seconds of every step. Not
        judged, there are no decibels, and the page is None.

    Raises:
        ContractError: If a word is wrong, or files exist that other words made.
        UnsupportedError: If torch is not installed, or the lens holds what camkit does not trace.
    """
    require_torch(command_text("make"), "onnxscript", *JUDGE)
    path = Path(out)
    work_path = path.with_suffix(WORK_SUFFIX) if work_dir is None else Path(work_dir)
    if minutes < 0:
        raise ContractError(f"minutes must be >= 0; got {minutes:g}")
    if minutes and not judge:
        raise ContractError(
            "a network enters a bundle only if it is judged better than the filter: without "
            f"judging give {option_text('minutes')} 0; got {minutes:g}"
        )
    if overwrite:
        remove_work(work_path)
        if not judge:
            path.with_suffix(PAGE_SUFFIX).unlink(missing_ok=True)  # of another camera
    elif not work_path.is_dir():
        refuse_existing((path, path.with_suffix(PAGE_SUFFIX)), overwrite=False)
    from camkit.models_def.torch_threads import one_torch_thread
    from camkit.report.making.camera_steps import CameraSteps, CameraWish
    from camkit.report.making.making_run import Making

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
    with one_torch_thread():
        return Making(CameraSteps(wish=wish, work=work), path, on_note or _ignore).run(judge=judge)


def _ignore(_text: str) -> None:
    """Drop a note."""
