"""Table 6.1, figures 6.7 and 6.8: which lens gives the best picture after recovery.

lens_at_rest   a lens that does not move in the loop of a design
depth_likeness  how alike its PSFs are over depths
lens_table     every lens, captured and recovered
lens_page      the tables
"""
