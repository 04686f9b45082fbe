"""Errors by which h5py tells of files that are damaged."""

from typing import Final

BROKEN: Final = (
    *(OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, OverflowError),
)
