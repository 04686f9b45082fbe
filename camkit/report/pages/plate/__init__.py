"""One plate on one page, in the order of its making.

plate_facts    everything that is computed about a plate, and its JSON
plate_charts   PSF, light along the streaks, relief
plate_page     the page
mask_files     what a plate is etched through, as images
dots           a unit of a plate of dots as arrays, and its masks
"""
