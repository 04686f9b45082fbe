"""Scenes at night, `night:SEED`: dark surfaces, and lights far above white.

canvas        surfaces and lights, and how something is put before or added to them
lamp          colours, powers and forms of lamps
facade        buildings with lit windows, windows from near
neon          bent tubes, lit panels with glyphs
bokeh         lamps out of focus
street        rows of lamps, cars, garlands, wires, railings
ground        paving and water, and what they mirror
town          sky, rows of buildings, lamps until enough is lit
places        street, waterfront, room, bokeh, fair
shading       what the lamps light
assembly         all of it, from a seed
"""

from camkit.runtime.kinds.hdr.night.assembly import night_scene

__all__ = ["night_scene"]
