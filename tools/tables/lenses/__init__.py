"""Table 6.1 and figures 6.5, 6.7, 6.8: which lens gives the best picture after recovery.

lens_at_rest   a lens that does not move in the loop of a design
lens_score     a lens and its network judged on fresh pictures
slanted_edge   contrast of what is recovered
lens_table     every lens, captured and recovered
lens_page      the tables and the picture
"""
