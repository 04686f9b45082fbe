"""One picture in a process of its own: `python -m tests.hostile.picture FILE`; prints peak MB."""

import sys
from pathlib import Path

from camkit.bundle.reader import open_bundle
from camkit.runtime.machine.memory import peak_rss_mb
from tests.hostile.trial import process

if __name__ == "__main__":
    process(open_bundle(Path(sys.argv[1])))
    print(peak_rss_mb())
