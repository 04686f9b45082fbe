"""The bank: pictures restored block by block, each with the PSF of its own place.

psf                  frozen PSF -> one kernel per colour, field height and azimuth
kernels_by_distance  the same at every distance, and a map of how near a scene is
cell_means           a capture in coarse cells
distance             the distance of the scene, found in those cells
place_blur           blur that varies from cell to cell, as few convolutions
place_undo           filters that nearly undo it, each for its place
haze                 the coarse band: the scene in cells, and the capture cleared by it
blocks               the grid of overlapping windowed blocks, and the sum of them
spectrum             Fourier transforms of blocks
lights               lights that clip, explained where they are
wiener               the Wiener filter of one block
joint_colours        the same for all colours of it together
mosaic               the same from the samples of its mosaic
richardson_lucy      the Richardson-Lucy rounds of one block
total_variation      least squares with total variation of one block, by ADMM
cross_channel        the same with edges of all colours in the same places
baselines            the classical methods on the same blocks
"""
