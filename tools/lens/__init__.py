"""Lens profiles of others, held against what is made of them; the thin plate, measured and drawn.

entries          every distortion of a lensfun database, converted
haze_trial       what undoing the haze of a thin plate gains
plate_figures    the ideal phase of a plate, its virtual apertures, rays and spots
physics_camera   the camera of a recipe without its networks
cameras          cameras by name, one light, any exposure
picture_strip    pictures beside each other
open_plate       the open plate beside its stop, by exposure time and length
plate_pinhole    the open plate beside a pinhole that is exposed as long
out_of_focus     widths of what is out of focus, before and after recovery
"""
