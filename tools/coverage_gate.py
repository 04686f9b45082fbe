"""Refuse a test run whose branch coverage of runtime, core or tools falls below 90 %."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

CORE = "camkit/bundle/*,camkit/scenes/*,runtime/kinds/hdr/streaks/*,camkit/*.py"
RUNTIME = "*/runtime/*"
TOOLS = "tools/*"
FLOOR_PERCENT = 90


FLOORS = (("runtime", RUNTIME), ("core", CORE), ("tools", TOOLS))


def main() -> int:
    """Print the report and return the exit code of the strictest part."""
    worst = 0
    with ThreadPoolExecutor() as side_by_side:
        totals = side_by_side.map(_total, (include for _, include in FLOORS))
        subprocess.run([sys.executable, "-m", "coverage", "report", "--skip-covered"], check=False)
        for (name, _), result in zip(FLOORS, totals, strict=True):
            print(f"branch coverage of {name}: {result.stdout.strip()} % (floor {FLOOR_PERCENT})")
            worst = max(worst, result.returncode)
    return worst


def _total(include: str) -> subprocess.CompletedProcess[str]:
    """Return the total of some files, and whether it reaches the floor."""
    return subprocess.run(
        [
            *(sys.executable, "-m", "coverage", "report", "--format=total"),
            *(f"--include={include}", f"--fail-under={FLOOR_PERCENT}"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )


if __name__ == "__main__":
    sys.exit(main())
