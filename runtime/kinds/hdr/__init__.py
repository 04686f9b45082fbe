"""Snapshot HDR: files and twin are those of any camera behind a mosaic."""

from camkit.runtime.kinds.bayer import PART

__all__ = ["PART"]
