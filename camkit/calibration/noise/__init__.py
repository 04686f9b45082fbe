"""The noise of a sensor from pairs of pictures: photon transfer.

frame_pairs     two frames read and held against each other, colour by colour
site      what a pair tells of one colour: means, noise in time, fixed patterns
rounding  what a converter leaves of noise that is finer than its step
transfer  the line of variance over mean: gain
sensor_noise   pairs of every ISO to gain, read noise, fixed patterns

References: EMVA 1288 release 4.0 linear; Janesick 2007, "Photon Transfer", ch. 5.
"""
