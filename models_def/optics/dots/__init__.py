"""Plates of dots: one small unit, side by side, that throws a wanted light into 11x11 dots.

A periodic plate in the front focal plane of a lens makes a lattice of dots, its diffraction orders.
Each falls on one sub-pixel of an array of small pixels, so the brightness of the dots is the PSF.

- `camera`: laser, lens, lattice and cells
- `target`: the light that is wanted, and how like it a light is
- `orders`: the field of one unit -> its 11x11 orders
- `gerchberg_saxton`: phases by turns between plate and picture, the thesis's way
- `merit`: what a plate is judged by, with its slope
- `refine`: phases by that slope
- `levels`: phases -> levels, not by rounding alone
- `unit`: levels as they are etched: heights, masks, light
- `pattern`: the dots through the real aperture, in focus and out
- `effective`: what the small pixels see of them, the PSF that training is given
- `beginning`: where in its period the unit begins
- `bottom`: which level is etched deepest
- `match`: all of it: a light that is wanted -> a plate that can be etched
"""
