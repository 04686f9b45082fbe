"""The bank: pictures restored block by block, each with the PSF of its own place.

psf               frozen PSF -> one kernel per colour, field height and azimuth
blocks            the grid of overlapping windowed blocks, and the sum of them
spectrum          Fourier transforms of blocks
wiener            the Wiener filter of one block
richardson_lucy   the Richardson-Lucy rounds of one block
baselines         the classical methods on the same blocks
"""
