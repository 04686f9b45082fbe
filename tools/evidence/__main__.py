"""Record, compare or time; see `tools.evidence`."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import tools.evidence
from tools.evidence.checkout import HERE
from tools.evidence.comparison import compare
from tools.evidence.record import make_record
from tools.evidence.seconds import compare_seconds, compare_whole


def main(words: list[str] | None = None) -> int:
    """Run one of the three commands; return its exit code."""
    arguments = _parser().parse_args(words)
    if arguments.command == "record":
        record = make_record(
            arguments.checkout,
            arguments.bundle,
            data=arguments.data,
            is_judged=arguments.judged,
        )
        text = json.dumps(record, indent=1, sort_keys=True, allow_nan=False)
        arguments.out.write_text(text + "\n", encoding="utf-8")
        return 0
    if arguments.command == "seconds":
        roots = arguments.a, arguments.b
        if arguments.whole:
            size = {"megapixels": arguments.megapixels, "threads": arguments.threads}
            compare_whole(roots, arguments.whole, arguments.rounds, **size)
        else:
            compare_seconds(roots, arguments.bundle, arguments.rounds)
        return 0
    comparison = compare(read_record(arguments.before), read_record(arguments.after))
    print(*comparison.lines(), sep="\n")
    return int(bool(comparison.changed))


def read_record(path: Path) -> dict[str, Any]:
    """Read what `record` wrote."""
    return dict(json.loads(path.read_text(encoding="utf-8")))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=tools.evidence.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True, dest="command")
    record = commands.add_parser("record", help="hash what a checkout computes")
    record.add_argument("out", type=Path)
    record.add_argument("--checkout", type=Path, default=HERE, help="default: this one")
    record.add_argument("--data", type=Path, help="folder of real captures, processed besides")
    record.add_argument(
        "--judged", action="store_true", help="also check, stress, bench and analyse: 15 minutes"
    )
    two = commands.add_parser("compare", help="compare two records; exit code 1 if they differ")
    two.add_argument("before", type=Path)
    two.add_argument("after", type=Path)
    seconds = commands.add_parser("seconds", help="time two checkouts in turn")
    seconds.add_argument("a", type=Path)
    seconds.add_argument("b", type=Path)
    seconds.add_argument("--rounds", type=int, default=5)
    seconds.add_argument(
        "--whole", nargs="+", metavar="BUNDLE:SIZE", help="a large photograph by each of these"
    )
    seconds.add_argument("--megapixels", type=float, default=24.0, help="of it")
    seconds.add_argument("--threads", type=int, default=2, help="for it")
    for command in (record, seconds):
        command.add_argument("--bundle", nargs="+", help="names of built-in bundles; default: all")
    return parser


if __name__ == "__main__":
    sys.exit(main())
