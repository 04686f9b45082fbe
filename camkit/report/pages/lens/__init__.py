"""One lens on one page, in the order of its making.

lens_facts     everything that is computed about a lens, and its JSON
layout         the lens drawn to scale, with rays and stop
spot_chart     spot diagrams with the Airy circle
mtf_chart      contrast with its diffraction limit
field_chart    field curvature, distortion, relative illumination
colour_chart   longitudinal aberration, axial and lateral colour
seidel_chart   third-order sums by surface
lens_page      the page
design_picture a moment of a joint design
yield_chart    Monte-Carlo samples of a fabricated lens: yield, classes of errors, table and JSON
"""
