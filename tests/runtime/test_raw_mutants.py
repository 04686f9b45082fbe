"""A thousand damaged copies of real RAW files: each is refused in a line, sound, or warned of."""

import re
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.capture import Capture
from camkit.runtime.raw import read_capture
from tests.data_folder import data_path
from tests.raw_mutants import Mutator

COUNTS = {
    "kodak_dc120_P003917.KDC": 200,
    "canon_eos6d_linear_lossy.dng": 180,
    "canon_g2_colorchecker_CRW_0304.CRW": 150,
    "canon_kissx4_magiclantern_colorchart.dng": 220,
    "blackmagic_pocket4k.dng": 180,
    "sony_a7rm3_crop_DSC2164.ARW": 50,
    "derived_24mp_rggb12.dng": 20,
}
SEED = 26128
DOUBT = re.compile("damage|too low|too high")
TIMEOUT_S, MAX_MEMORY_MB = 30.0, 2048
OTHER_DIFFERENCE, OTHER_SIDE = 0.1, 0.01
SILENT_SHARE, LEAST_SILENT = 0.01, 1
"""One may remain among few: black 512 -> 0 of 65535 changes the light by 10 % and nothing else."""


def _light(capture: Capture) -> NDArray[Any]:
    """Give every third row and column as linear light."""
    return capture.linear_rows(0, capture.height)[..., ::3, ::3]


def _is_other(capture: Capture, sound: Capture, light: NDArray[Any]) -> bool:
    """Tell whether a copy became something else: its size, its pattern, or most of its light."""
    sides = (capture.height / sound.height, capture.width / sound.width)
    if capture.samples.ndim != sound.samples.ndim or max(abs(s - 1) for s in sides) > OTHER_SIDE:
        return True
    if capture.cfa != sound.cfa and sides == (1, 1):
        return True
    found = _light(capture)
    high, wide = (min(a, b) for a, b in zip(found.shape[-2:], light.shape[-2:], strict=True))
    one, two = found[..., :high, :wide], light[..., :high, :wide]
    return float(np.median(np.abs(one - two))) > OTHER_DIFFERENCE * float(np.median(np.abs(light)))


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_of_a_thousand_mutants_none_passes_for_another_picture_without_a_word(
    tmp_path: Path,
) -> None:
    counts: Counter[str] = Counter()
    silent: list[str] = []
    began = time.monotonic()
    for name, count in COUNTS.items():
        path = data_path("raw") / name
        sound = read_capture(path)
        light, known = _light(sound), set(sound.notes)
        copy = tmp_path / name
        for mutant in Mutator(path).mutants(count, SEED):
            copy.write_bytes(mutant.data)
            started = time.monotonic()
            try:
                capture = read_capture(copy, timeout_s=TIMEOUT_S, max_memory_mb=MAX_MEMORY_MB)
            except DecodeError as error:
                counts["refused" if "\n" not in str(error) else "refused in lines"] += 1
                continue
            finally:
                assert time.monotonic() - started < TIMEOUT_S + 10, mutant.detail
            warned = any(DOUBT.search(note) for note in set(capture.notes) - known)
            other = _is_other(capture, sound, light)
            counts[f"{'other' if other else 'the same'}, {'warned' if warned else 'silent'}"] += 1
            if other and not warned:
                silent.append(f"{name}: {mutant.kind}, {mutant.detail}")
    others = counts["other, warned"] + counts["other, silent"]
    print(f"\n{dict(counts)}, {others} other pictures, {time.monotonic() - began:.0f} s")
    print("\n".join(silent))
    assert sum(counts.values()) == 1000
    assert "refused in lines" not in counts
    assert others >= 10
    assert len(silent) <= max(LEAST_SILENT, SILENT_SHARE * others), silent
