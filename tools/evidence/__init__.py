"""Evidence that two checkouts compute the same: products, plans, `--json` outputs, seconds.

    python -m tools.evidence record OUT.json [--checkout DIR] [--bundle NAME ...] [--data DIR]
    python -m tools.evidence compare BEFORE.json AFTER.json
    python -m tools.evidence seconds CHECKOUT_A CHECKOUT_B [--whole BUNDLE:SIZE ...]

checkout    another checkout's camkit, in child processes: commands, and a worker
captures    small captures of every built-in bundle, simulated from fixed seeds
ways        the options by which each capture is processed
commands    the command line with `--json`, and the files that it writes
real        captures by real cameras, where somebody has them
worker      the child: one capture processed by the public Python face
whole_picture  the child for one large photograph
samples     hashes of arrays and of the samples of files
scrubbed    JSON without clocks, memory, versions and folders
record      a record made
comparison  two records compared
seconds     two checkouts timed in turn
"""
