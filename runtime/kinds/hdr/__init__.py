"""Snapshot HDR: files and twin are those of any camera behind a mosaic.

stages    what its bundles list
streaks   clipped lights, read from the streaks that a plate writes beside them
deglare   streaks of a wiped windshield, whose optics nobody knows, taken away
night     `night:SEED`, scenes with lights far above white
"""

from camkit.runtime.kinds.bayer import PART

__all__ = ["PART"]
