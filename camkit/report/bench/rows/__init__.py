"""Row makers: every module here defines `ROWS`, a `camkit.report.bench.row_maker.RowMaker`.

classical   the classical methods on the bundle's blocks
develop     no reconstruction at all
physics     the optics alone, where a stage of the bundle knows that
network     the networks of a bundle: sizes, modes, precisions, providers, threads, tiles
"""
