"""Vignetting from pictures of an uneven display or wall, told from its own unevenness.

picture   a picture as the mean light of green in blocks
pose      how what is photographed lies in a picture
spline    smooth functions of the radius and of a place
separate  lens, display and exposures by least squares, and whether they can be told apart
illumination_fit   pictures to relative illumination
"""
