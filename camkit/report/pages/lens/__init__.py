"""One lens on one page, in the order of its making.

lens_pupil     the pupil and the sampling that are used, and why
lens_image     images of points: Strehl ratios, encircled energy
lens_facts     everything that is computed about a lens
lens_json      its JSON
left_out       the fields that charts leave out
layout         the lens drawn to scale, with rays and stop
spot_charts    spots, alone or below those of another lens
lens_charts    contrast, curves over the field and over colour, third-order sums
fan_charts     ray fans and OPD fans
image_charts   pictures of points, encircled energy
lens_page      the page
design_picture  a moment of a joint design
yield_chart    Monte-Carlo samples of a fabricated lens: yield, classes of errors, table and JSON
"""
