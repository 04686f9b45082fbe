"""The command line: one file per command, grouped by task.

    use       captures in, pictures out: process, plan, simulate, info
    judge     what a camera and this machine are worth: check, stress, bench, doctor
    design    a camera made at design time (torch): design, freeze, train, export, lens ...

`app` joins the commands, in the groups of the help (`groups`), and turns errors into one line and
an exit code (`exit_code`). `choices` are options that several commands share. `progress` shows what
long work counts, `say` is the one way to a terminal. A new command is a file in the folder of its
task and a line in `app`.
"""

import os

# Where numpy multiplies small matrices, OpenBLAS's threads would go on asking for work for 30 ms
# after each product, at the cost of everybody else's. It reads this when numpy is imported.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")

# Pages of 2 MB are cleared whole for arrays that are filled and freed at once.
os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")

from camkit.cli.app import main

__all__ = ["main"]
