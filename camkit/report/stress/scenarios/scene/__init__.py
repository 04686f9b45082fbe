"""The scene is known to the last pixel, so that whatever else a picture shows was added.

stars   lone stars on a dark sky: satellites around them
limb    an even disc on black: a wobbling limb, a dark seam, a bright rim
"""
