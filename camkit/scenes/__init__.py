"""Scenes that need no data: sharp linear pictures, drawn from a seed.

texture       colours and textures with the spectrum of nature
leaves        dead leaves: what the statistics of natural images are made of
lettering     lines of made-up glyphs
procedural    `procedural:SEED`, a bit of everything
clean         edges, stars and discs whose truth is known to the last pixel
slanted_edge  a sharp edge, to measure an MTF on
squares       `squares:SEED`, dark squares on white, to measure the focus of a camera body on
charts        lamps and patches on which the laws of a picture are held
saturation    the exposure at which a share of a scene saturates
scene_register  a scene by its name; those that a kind of camera brings too (`night:SEED`)
"""

from camkit.scenes.procedural import procedural_scene
from camkit.scenes.scene_register import is_scene_name, named_scene

__all__ = ["is_scene_name", "named_scene", "procedural_scene"]
