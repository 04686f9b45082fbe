"""Kinds of rows: every module here defines `KIND`, a `camkit.report.bench.row_kind.RowKind`.

classical   the classical methods on the bundle's blocks
develop     no reconstruction at all
network     the networks of a bundle: sizes, modes, precisions, providers, threads, tiles
"""
