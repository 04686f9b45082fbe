"""Lens profiles of lensfun's database, to bundles and back.

xml        one file of the database, read safely
database   lenses by name, and their entries
models     lensfun's formulas of distortion, as odd and even powers
interpolation  entries between measured focal lengths
profile    the lens profile of a lens for captures like one
camera     sensor and stages of a bundle of that lens
ordinary   database and capture to that bundle
source     the distortion of a bundle or of a measured geometry
entry      the entry that lensfun reads
"""
