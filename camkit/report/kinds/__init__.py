"""The kinds of cameras that come with camkit and are more than photographs to reports.

hdr    snapshot HDR: two captures of a scene, scenarios of lights and streaks
spad   single photons: they measure themselves, scenarios of light, plate and times
"""
