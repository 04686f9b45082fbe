"""Fluorescence: how long it takes to fade, for every pixel of a histogram.

decay   shares of a pulse that an exponential decay lets out late, with their slopes
starts  a coarse bank over lifetimes and times, from which fits begin
fitter  the likeliest lifetime, time, amplitude and background of every pixel
guess   the width of a pulse that nobody stated
"""
