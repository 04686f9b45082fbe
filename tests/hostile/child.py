"""Hostile bundles tried in a process of their own: `python -m tests.hostile.child FIRST COUNT`.
A bundle of one's own is tried by its path: `python -m tests.hostile.child FILE.camkit`.

One JSON line before each case ({"seed"}) and one behind it ({"end", "seconds", "peak_mb"}), so that
who reads them knows which case a crash, a hang or a killing belongs to.
"""

import json
import os
import resource
import sys
import tempfile
import time
import traceback
from pathlib import Path

from camkit.runtime.machine.memory import peak_rss_mb
from tests.hostile.generator import hostile_bundle, seeded_decisions
from tests.hostile.trial import try_bundle
from tests.installed_package import write_entry_points
from tests.toy_camera.install import PACKAGE, POINTS

TIGHT = {
    "CAMKIT_MAX_NETWORK_WORK": "2e5",
    "CAMKIT_MAX_PROOF_WORK": "2e10",
    "CAMKIT_MAX_PROOF_MB": "400",
}
"""Limits for many cases in little time, and room for what they hold beside the proofs."""
ADDRESS_BYTES = 8 * 2**30
"""A ceiling far above what any case may take, so that none brings the machine to its knees."""
_CLEAR_PEAK = "5"


def main(first: int, count: int) -> None:
    """Try numbered cases, one after the other."""
    os.environ.update(TIGHT)
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_BYTES, ADDRESS_BYTES))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_entry_points(folder, PACKAGE, POINTS)
        sys.path.insert(0, str(folder))
        for seed in range(first, first + count):
            _tell(seed=seed)
            path = folder / "hostile.camkit"
            path.write_bytes(hostile_bundle(seeded_decisions(seed)))
            _tell(**tried(path))


def tried(path: Path) -> dict[str, object]:
    """Try one bundle; give how it ended, its seconds and its peak memory."""
    clear_peak()
    began = time.perf_counter()
    try:
        end = try_bundle(path)
    except Exception:  # noqa: BLE001 - every kind is a finding, told and gone on from
        end = traceback.format_exc()
    return {"end": end, "seconds": time.perf_counter() - began, "peak_mb": peak_rss_mb()}


def clear_peak() -> None:
    """Begin to count the peak memory of this process anew, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text(_CLEAR_PEAK, encoding="ascii")
    except OSError:
        return


def _tell(**facts: object) -> None:
    print(json.dumps(facts), flush=True)


if __name__ == "__main__":
    if len(sys.argv) == 2:  # a bundle, within the limits of everybody
        _tell(**tried(Path(sys.argv[1])))
    else:
        main(int(sys.argv[1]), int(sys.argv[2]))
