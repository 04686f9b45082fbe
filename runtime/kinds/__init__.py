"""Kinds of cameras at use time: one folder each, which defines `PART` (`camkit.runtime.kind`).

bayer    colour photographs behind a mosaic: RAW, DNG, EXR, TIFF and PNG; lens and sensor as twin
"""
