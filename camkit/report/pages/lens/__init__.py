"""One lens on one page, in the order of its making.

lens_facts     everything that is computed about a lens, and its JSON
layout         the lens drawn to scale, with rays and stop
lens_charts    spots, contrast, curves over the field and over colour, third-order sums
lens_page      the page
design_picture  a moment of a joint design
yield_chart    Monte-Carlo samples of a fabricated lens: yield, classes of errors, table and JSON
"""
