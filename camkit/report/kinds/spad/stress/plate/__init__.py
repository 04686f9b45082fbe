"""Plates and arrays that are not as the bundle says; each module defines `SCENARIO`.

plate_rotation, plate_shift   the plate lies elsewhere
defocus, etch_depth           its dots are blurred, or mixed with light that passed straight
active_area, sample_phase     the pixels see more or less of the dots, or other ones
"""
