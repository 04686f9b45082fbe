"""Kinds of cameras at use time: one folder each, which defines `PART` (`camkit.runtime.kind`).

bayer    colour photographs behind a mosaic: RAW, DNG, EXR, TIFF and PNG; lens and sensor as twin
hdr      snapshot HDR: lights read from their streaks, glare of a windshield, scenes at night
spad     single photons: files, products and twin of arrays that count them
"""
