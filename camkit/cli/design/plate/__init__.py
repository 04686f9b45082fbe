"""`camkit plate`: commands for one plate, a file or a built-in one by its name.

- `plate_app`: the commands joined
- `plate_show`: a plate on one page
- `plate_design`: a relief by gradients, from a recipe
- `masks`: what it is etched through
- `match`: a plate of dots for a PSF
- `target`: that PSF, read
- `sensor`: the sensor of a recipe, which they look through
"""
