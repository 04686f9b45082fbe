"""What export knows of single kinds of cameras: one folder each, where there is something.

A folder defines `PREPARING` (`camkit.export.preparing`) where samples are made before training.
"""
