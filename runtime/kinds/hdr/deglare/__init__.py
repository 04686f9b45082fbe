"""Glare: two opposite streaks through every light, as a wiped windshield writes them, taken away.

    slant       a picture sheared so that its streaks stand upright
    overview    a small picture of the whole, and where its lights are
    direction   the one angle of the streaks, from what lies above and below the lights
    arms        how much light every light throws along its column
    profile     how streaks fade along their arms
    removal     all of it: rows -> streaks -> rows without them

References: Sun 2021, section 5.7.1: a two-point star through every light (the parametrisation of
Rouf et al. 2011), turned by one angle per picture. The thesis removes it by a network; here the
angle, the fading and every streak are estimated from the picture itself.
"""
