"""What a camera is, from photographs of something known.

darks      what a sensor shows without light, taken off every exposure
lattice    the samples of one colour on their own lattice, and their values anywhere
light      the point light of a merged bracket found: its place, its core, the dark around it
disc       a light that is an even disc, taken out of its own picture
patch      the light around it, colour by colour, less its background
peak       how much of it lies near its peak, and how sure that is
trim       how far its light stands out of the noise, and the noise itself smoothed
measured   a PSF as it was measured, and what is told of it
psf        all of it: a bracket of a small light to a frozen PSF
edge_psf   a slanted edge to a PSF that is round
dots       one through a plate of dots to the PSF that an array of small pixels sees
edges      straight edges of a target found in a capture, and their profile in every colour
focus      the focus of a unit, out of captures of edges
flat/      pictures of an uneven display to relative illumination
noise/     pairs of frames to gain, read noise and fixed patterns of every ISO
tone       pictures of grey steps to the tone curve of a display
geometry/  focal length, optical centre and distortion, from a checkerboard
display/   what a display shows, and captures of it as pairs for training
record     what a calibration found, as TOML
measured_files  that TOML read back
lensfun/   lenses of lensfun's database
"""
