"""Light on the sensor, and what the sensor makes of it.

exposure, flat_field           too dark, too bright, nothing to see
saturated_area, blob_size      clipped lights, many and large
noise, noise_above_stated      stated and hidden noise
bit_depth, black_level         steps of the converter, and its zero
dead_pixels, invalid_pixels    stuck samples, NaN and infinities
"""
