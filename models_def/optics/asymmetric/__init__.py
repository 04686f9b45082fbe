"""Lenses that are not round: a free phase, an element that is tilted or decentred.

Everything else of camkit traces fields along +y. A field at another azimuth of such a lens is the
field along +y of the lens turned, whose landings are turned back.

- `turning`: the lens turned, and without what makes it uneven
- `places`: the field whose chief ray lands at a place of the sensor
- `place_psf`: kernels at places of the sensor
"""
