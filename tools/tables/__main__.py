"""Train and measure a table: `python -m tools.tables TABLE train|measure --help`."""

import sys
from typing import Final

from tools.tables.hdr.night_table import TABLE as NIGHTS
from tools.tables.lenses.lens_table import TABLE as LENSES
from tools.tables.losses.loss_table import TABLE as LOSSES
from tools.tables.runner import run
from tools.tables.spad.array_table import TABLE as ARRAYS

TABLES: Final = {"spad": ARRAYS, "hdr": NIGHTS, "losses": LOSSES, "lenses": LENSES}

if __name__ == "__main__":
    run(TABLES, sys.argv[1:])
