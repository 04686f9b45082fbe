"""Captures of real single-photon cameras, made by camkit and held against what is known of them.

    python -m tools.spad.real_data FOLDER --out-dir out/spad

FOLDER holds the captures that `tools/spad/real` names; one that is absent is told and left out.
Writes spad-real.json and pictures to look at, prints a table. The captures are not ours to pass on,
nor are pictures made of them.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from camkit.report.bench.machine import describe_machine
from tools.spad.real import confocal, edges, layers, lifetimes, planes, stream, tower
from tools.spad.real.claim import Claim, table

Measure = Callable[[Path, Path], list[Claim]]
CAPTURES: Final[dict[str, tuple[Measure, tuple[str, ...]]]] = {
    "planes": (planes.measure, (planes.FILE,)),
    "tower": (tower.measure, (tower.FILE,)),
    "layers": (layers.measure, (layers.FILE, layers.REFERENCE)),
    "confocal": (confocal.measure, confocal.FILES),
    "lifetimes": (lifetimes.measure, (lifetimes.FILE,)),
    "stream": (stream.measure, (stream.FILE, stream.REFERENCE)),
    "edges": (edges.measure, (edges.FILE,)),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure every capture that is there."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out-dir", type=Path, default=Path("out/spad"))
    parser.add_argument("--only", nargs="+", choices=sorted(CAPTURES), default=list(CAPTURES))
    options = parser.parse_args(arguments)
    options.out_dir.mkdir(parents=True, exist_ok=True)
    claims: list[Claim] = []
    for name in options.only:
        measure, files = CAPTURES[name]
        absent = [file for file in files if not (options.folder / file).is_file()]
        if absent:
            print(f"{name}: {', '.join(absent)} is not in {options.folder}", file=sys.stderr)
            continue
        claims += measure(options.folder, options.out_dir)
    print(table(claims))
    record = {"machine": describe_machine(), "claims": [claim.row() for claim in claims]}
    path = options.out_dir / "spad-real.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return 0 if claims else 1


if __name__ == "__main__":
    sys.exit(main())
