"""A bundle proves what it says about itself.

check        all layers of `camkit check`
layers       those that run something: golden cases, exact tiling, range of activations
golden_run   a golden case through the whole pipeline
haze_band    the coarse band of a haze, on the whole sensor
one_window   networks that look at the whole picture
laws/        laws that a picture keeps, whatever it shows
"""
