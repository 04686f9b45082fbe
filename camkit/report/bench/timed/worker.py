"""The process whose time and memory are measured: files to pictures, as `camkit process`.

    python -m camkit.report.bench.timed.worker JOB     JOB is the JSON of a `process_run.Job`

Prints one JSON line per file as soon as its picture lies on the disk. The first file pays for
imports, bundle and session; the later ones find them ready. A slow file is the last one.
"""

import json
import os
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from camkit.runtime.development import FileResult


def main(text: str) -> None:
    """Run a job."""
    os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")  # as the command line does
    import camkit
    from camkit.runtime.machine.memory import keep_memory_for_good

    keep_memory_for_good()
    job: dict[str, Any] = json.loads(text)

    def tell(result: "FileResult") -> None:
        _tell(result)
        if sum(result.seconds.values()) > job["repeat_within_s"]:
            raise SystemExit(0)

    camkit.process(
        job["files"],
        bundle=job["bundle"],
        out_dir=job["out_dir"],
        overwrite=True,
        on_result=tell,
        **job["options"],
    )


def _tell(result: "FileResult") -> None:
    times = os.times()
    line = {
        "status": result.status,
        "error": result.error,
        "seconds": result.seconds,
        "peak_rss_mb": result.peak_rss_mb,
        "cpu_s": times.user + times.system + times.children_user + times.children_system,
    }
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    from camkit.errors import CamkitError

    try:
        main(sys.argv[1])
    except CamkitError as error:
        raise SystemExit(f"{error}") from error
