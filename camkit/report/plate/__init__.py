"""One plate on one page, in the order of its making.

facts          everything that is computed about a plate, and its JSON
psf_chart      the PSF over the camera's colours, beside that of the bare lens
cut_chart      light along the streaks, and how much lies farther out
height_chart   the relief, whole and its middle
masks          what it is etched through, as images
dots           a unit of a plate of dots as arrays, and its masks
page           the HTML page, complete in itself
output         all files written
"""
