"""A photon stream of Becker & Hickl against its decoding by the maker's own program."""

from pathlib import Path
from typing import Final

import numpy as np

from camkit.runtime.kinds.spad.files.spc import decode_spc
from tools.spad.real.claim import Claim
from tools.spad.real.face import product

FILE: Final = "bh_test_noise.spc"
REFERENCE: Final = "bh_test_noise.asc"
TIMING: Final = """
[timing]
orientation = "histogram"
time_bin_ps = 16
first_ps = 0
bins = 4096
[array]
stamp_ps = 16
"""


def measure(folder: Path, out: Path) -> list[Claim]:
    """Compare every stamp, and the histogram that camkit makes of them."""
    del out
    macro, micro = np.loadtxt(folder / REFERENCE, dtype=np.int64).T
    photons = decode_spc((folder / FILE).read_bytes())
    equal = len(macro) == len(photons.macro) and bool(
        np.array_equal(macro, photons.macro) and np.array_equal(micro, photons.micro)
    )
    made = product(folder / FILE, TIMING, product="transient")
    expected = np.bincount(micro, minlength=4096)
    same = np.array_equal(made.arrays["transient"][:, 0, 0], expected)
    return [
        Claim(capture=FILE, what="photons", value=len(photons.macro)),
        Claim(capture=FILE, what="all stamps equal those of the .asc", value=equal, least=1),
        Claim(capture=FILE, what="histogram equals that of the .asc", value=same, least=1),
    ]
