"""Samples of a lens with a haze: cut from whole frames, since a patch holds none.

`camkit.export.frames` photographs the frames and takes their haze away, with the runtime.

tiles      parts of frames on disk, behind the haze and before the bank
samples    tiles through the bank: samples to train on, captures to choose by
"""
