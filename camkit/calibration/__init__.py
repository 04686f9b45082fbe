"""Measurement of a camera from photographs of known subjects.

darks      dark current, hot pixels and error of the black level, by exposure time
lattice    the samples of one colour on their own lattice, and values between them
light      the point light in a merged bracket: its place, its core, the dark around it
disc       a light that is an even disc, removed from its own picture
patch      the light around the point, colour by colour, without its background
peak       the share of the light near the peak, and its standard error
trim       the signal-to-noise ratio of the light, and smoothing of what is only noise
measured   a measured PSF and the facts about it
psf        the whole measurement: a bracket of a small light to a frozen PSF
edge_psf   a slanted edge to a PSF that is round
dots       one light through a plate of dots to the PSF that an array of small pixels sees
blur/      edges in ordinary photographs to the PSF of a lens over the field
edges      straight edges of a target in a capture, and their profile in every colour
focus      the focus of a camera body, from captures of edges
flat/      pictures of an uneven display to relative illumination
noise/     pairs of frames to gain, read noise and fixed patterns of every ISO
tone       pictures of grey steps to the tone curve of a display
geometry/  focal length, optical centre and distortion, from a checkerboard
display/   targets on a display, and captures of them as pairs for training
blur_pair/  two pictures of one plane to the blur between them
record     the result of a calibration, as TOML
measured_files  the reader of that TOML
psf_import/  kernels that others measured or computed, from their files to a PSF
lensfun/   lenses of lensfun's database
"""
