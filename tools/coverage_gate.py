"""Refuse a test run whose branch coverage of runtime, core or tools falls below 90 %."""

import subprocess
import sys

CORE = "camkit/bundle/*,camkit/scenes/*,runtime/kinds/hdr/streaks/*,camkit/*.py"
RUNTIME = "*/runtime/*"
TOOLS = "tools/*"
FLOOR_PERCENT = 90


def main() -> int:
    """Print the report and return the exit code of the strictest part."""
    subprocess.run([sys.executable, "-m", "coverage", "report", "--skip-covered"], check=False)
    worst = 0
    for name, include in (("runtime", RUNTIME), ("core", CORE), ("tools", TOOLS)):
        result = subprocess.run(
            [
                *(sys.executable, "-m", "coverage", "report", "--format=total"),
                *(f"--include={include}", f"--fail-under={FLOOR_PERCENT}"),
            ],
            capture_output=True,
            text=True,
            check=False,
        )
        print(f"branch coverage of {name}: {result.stdout.strip()} % (floor {FLOOR_PERCENT})")
        worst = max(worst, result.returncode)
    return worst


if __name__ == "__main__":
    sys.exit(main())
