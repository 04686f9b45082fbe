"""Settings of a bench, checked once."""

import math
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from camkit.errors import ContractError
from camkit.report.bench.trial import Axes

DEFAULT_REPEAT = 3
QUICK_SIZE_PX = (512, 384)
QUICK_METHODS = 2
"""Of every bundle, the best first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Everything that decides a bench.

    Attributes:
        bundles: Names or paths.
        references: Names or paths of bundles that stand beside the one of the same camera.
        axes: Which rows.
        repeat: Fresh processes per row.
        width_px: Of the capture that is timed; None for the sensor's.
        height_px: Likewise.
        small: A side that is not given is that of `QUICK_SIZE_PX`, if the sensor is larger.
        capture: A capture to time instead of the procedural one.
        photo: A sharp picture that every camera photographs for it, likewise.
        data: Folder of sharp pictures to measure accuracy on; None for the golden cases, or for
            the scenes that a kind of camera names.
        images: Only the first N of them.
        saturate: Share of their pixels that are exposed to saturate the sensor; None leaves them
            as bright as they are.
        work_dir: Where captures and traced PSFs are kept between runs; None for a folder of this
            user among the temporary files.
        gemm_s: Seconds spent on the speed of the matrix product, per number of threads.
        constants: What metrics may take that is the same for all captures, by name.
    """

    bundles: tuple[str, ...]
    references: tuple[str, ...] = ()
    axes: Axes = field(default_factory=Axes)
    repeat: int = DEFAULT_REPEAT
    width_px: int | None = None
    height_px: int | None = None
    small: bool = False
    capture: Path | None = None
    photo: Path | None = None
    data: Path | None = None
    images: int | None = None
    saturate: float | None = None
    work_dir: Path | None = None
    gemm_s: float = 1.0
    constants: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.bundles:
            raise ContractError("a bench needs at least one bundle; give a NAME or PATH, or --all")
        for name, value in (("repeat", self.repeat), ("images", self.images)):
            if value is not None and value < 1:
                raise ContractError(f"{name} must be >= 1; got {value}")
        for name, side in (("width", self.width_px), ("height", self.height_px)):
            if side is not None and (side < 64 or side % 2):
                raise ContractError(f"{name} must be even and at least 64 px; got {side}")
        for name, path in (("capture", self.capture), ("photo", self.photo)):
            if path is not None and not path.is_file():
                raise ContractError(f"there is no {name} {path}")
        if self.capture is not None and self.photo is not None:
            raise ContractError("give a capture or a photo to take one of, not both")
        if self.capture is not None and (self.width_px or self.height_px):
            raise ContractError("a capture has its own size; leave out width and height")

        self._check_accuracy()

    def _check_accuracy(self) -> None:
        if self.saturate is not None and not 0 < self.saturate < 1:
            raise ContractError(f"saturate must lie between 0 and 1; got {self.saturate:g}")
        for name, number in self.constants.items():
            if not 0 < number < math.inf:
                raise ContractError(f"{name} must be > 0; got {number:g}")

    def folder(self) -> Path:
        """Return the folder for captures and PSFs, which only this user can read, and make it."""
        if self.work_dir is not None:
            self.work_dir.mkdir(parents=True, exist_ok=True)
            return self.work_dir
        user = os.getuid() if hasattr(os, "getuid") else os.getlogin()
        folder = Path(tempfile.gettempdir()) / f"camkit-bench-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        if hasattr(os, "getuid") and folder.stat().st_uid != os.getuid():
            raise ContractError(f"{folder} belongs to another user; give another with --work-dir")
        return folder
