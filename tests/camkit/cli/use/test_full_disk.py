"""A disk that is full: one line, exit code 1, nothing half done, and never a hang."""

import json
import resource
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

LIMIT_BYTES = 40_000
SHAPE = (400, 600)


def _process(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run `camkit process` where no file may grow beyond the limit."""
    mosaic = np.random.default_rng(0).integers(100, 900, SHAPE, dtype=np.uint16)
    cv2.imwrite(str(folder / "shot.png"), mosaic)
    return subprocess.run(
        [
            *(sys.executable, "-m", "camkit", "process", str(folder / "shot.png")),
            *("--mosaic", "RGGB", "--black-level", "64", "--white-level", "1023"),
            *("--bundle", "none", "--out-dir", str(folder / "out"), *options),
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, LIMIT_BYTES)),
    )


@pytest.mark.parametrize("format_", ["exr", "tiff", "png", "dng"])
def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path, format_: str) -> None:
    done = _process(tmp_path, "--format", format_)
    assert done.returncode == 1
    said = [line for line in done.stderr.splitlines() if "shot" in line]
    assert len(said) == 1, done.stderr
    assert "File too large" in said[0] or "the disk is full" in said[0]
    assert list((tmp_path / "out").iterdir()) == []


def test_programs_are_told_likewise(tmp_path: Path) -> None:
    done = _process(tmp_path, "--json")
    (told,) = (json.loads(line) for line in done.stdout.splitlines())
    assert (done.returncode, told["status"]) == (1, "failed")
    assert "File too large" in told["error"]
