"""Coverage-guided search for bundles that camkit does not stand: `make fuzz`.

atheris (libFuzzer for Python) changes decisions, keeps those that reach new code of camkit, and
stops at the first that ends in anything but success or a refusal. What it kept lies in `corpus`
beside this file and is where the next search begins; what it found is written as a bundle.

    FUZZ_SECONDS   how long, 600 unless said
    FUZZ_OUT       folder for finds, out/fuzz unless said
"""

import os
import sys
import tempfile
from pathlib import Path

import atheris

CORPUS = Path(__file__).with_name("corpus")
SEEDS = 64

with atheris.instrument_imports(include=["camkit"]):
    from tests.hostile.child import TIGHT
    from tests.hostile.generator import DECISION_BYTES, hostile_bundle, seeded_decisions
    from tests.hostile.trial import try_bundle
    from tests.installed_package import write_entry_points
    from tests.toy_camera.install import PACKAGE, POINTS


def main() -> None:
    """Search."""
    os.environ.update(TIGHT)
    seconds = int(os.environ.get("FUZZ_SECONDS", "600"))
    out = Path(os.environ.get("FUZZ_OUT", "out/fuzz")).resolve()
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_entry_points(folder, PACKAGE, POINTS)
        sys.path.insert(0, str(folder))
        seeds = folder / "seeds"
        seeds.mkdir()
        for seed in range(SEEDS):
            (seeds / f"{seed}").write_bytes(seeded_decisions(seed))
        path = folder / "hostile.camkit"

        def one(decisions: bytes) -> None:
            path.write_bytes(hostile_bundle(decisions))
            try:
                try_bundle(path)
            except BaseException:
                (out / "found.camkit").write_bytes(path.read_bytes())
                raise

        limits = [f"-max_total_time={seconds}", "-timeout=60", "-rss_limit_mb=3000"]
        sizes = [f"-max_len={DECISION_BYTES}", f"-artifact_prefix={out}/", "-print_final_stats=1"]
        CORPUS.mkdir(exist_ok=True)
        atheris.Setup([sys.argv[0], *limits, *sizes, str(CORPUS), str(seeds)], one)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
