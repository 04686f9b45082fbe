"""Refuse a test run whose branch coverage of runtime and core falls below 90 %."""

import subprocess
import sys

CORE = "camkit/bundle/*,camkit/*.py"
RUNTIME = "*/runtime/*"
FLOOR_PERCENT = 90


def main() -> int:
    """Print the report and return the exit code of the stricter half."""
    subprocess.run([sys.executable, "-m", "coverage", "report", "--skip-covered"], check=False)
    worst = 0
    for name, include in (("runtime", RUNTIME), ("core", CORE)):
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
