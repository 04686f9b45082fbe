"""Geometry: places on the sensor, through the lens, and back.

sensor_window   pixels of a capture to millimetres from the axis
placement       where a capture lies on a bundle's sensor
shrink          planes made smaller by whole numbers
enlarging       pictures made larger by whole numbers, band by band
field_blur         spatially varying blur, for the digital twin
illumination    vignetting, and its division
distortion      the radial model, its inverse and its fit
resampling      samples between pixels, without rings around lamps
turning         pictures turned upright as EXIF says, and back
warp            pictures distorted and undistorted, band by band
"""
