"""Write bundles anew in the newest format: `python -m tools.repack OLD.camkit -o NEW.camkit`.

The manifest is brought up to date, golden pictures are packed as they are today, every other member
keeps its bytes. The result proves itself before it gets its name.
"""

import argparse
import tempfile
from pathlib import Path

from camkit.bundle.golden import golden_from_bytes, golden_to_bytes
from camkit.bundle.reader import GOLDEN, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ParityError
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work


def repack(old: Path, new: Path) -> int:
    """Write one bundle anew; give its bytes.

    Raises:
        BundleError: If the old one is damaged.
        ParityError: If the new one fails its check; nothing is written then.
    """
    bundle = open_bundle(old)
    members = {name: bundle.member(name) for name in bundle.names}
    if GOLDEN in members:
        members[GOLDEN] = golden_to_bytes(golden_from_bytes(members[GOLDEN]))
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / "trial.camkit"
        write_bundle(trial, bundle.manifest, members)
        report = check_bundle(trial, run=case_work)
    if not report.passed:
        raise ParityError("the new bundle fails its check: " + "; ".join(report.lines()))
    write_bundle(new, bundle.manifest, members)
    return new.stat().st_size


def main() -> None:
    """Repack what the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("old", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    arguments = parser.parse_args()
    before = arguments.old.stat().st_size
    after = repack(arguments.old, arguments.out)
    print(f"{arguments.out}: {after} bytes, before {before}")


if __name__ == "__main__":
    main()
