"""The digital twin: what the camera would record of a sharp scene.

saturation   scene -> the exposure at which a share of it clips
haze_spread  light that falls far from its peaks, in coarse cells
light        scene -> distortion -> blur that varies over the field -> Light on the sensor
exposure     Light -> illumination, mosaic, photons, amplifier, converter -> DN
truth        the picture of a perfect camera
simulate     capture and truth
"""
