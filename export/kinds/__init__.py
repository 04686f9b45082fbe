"""Export of single kinds of cameras: one folder for each kind that needs code of its own.

A folder defines `PREPARING` (`camkit.export.preparing`) where samples are made before training.
"""
