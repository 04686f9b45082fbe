"""`camkit calibrate`: a camera measured on photographs of something known, by `camkit.calibrate`.

calibrate_app   the commands joined
calibration_outputs   options and printed text that they share
psf       the point spread function, from a bracket of a point, of a disc, or from an edge
geometry  focal length, optical centre and distortion, from photographs of a checkerboard
flat      relative illumination, from pictures of an uneven display in several poses
noise     gain, read noise and fixed patterns, from pairs of dark and flat frames
distance  what the distances of a lens count from, from two pictures of one plane
targets   what a display shows to be photographed
pairs     captures of it as pairs for training
bundle    what was measured, into a copy of a bundle
lensfun_in    a lens of lensfun's database, to a bundle
lensfun_out   distortion and vignetting, to an entry that lensfun reads
tone      the tone curve of a display, from pictures of grey steps
"""
