"""Two pictures of one plane, one of them blurred: which blur turns the sharp one into the other.

    files -> light and codes -> registered -> blurred block by block -> gain -> errors by tile

picture_pair   the two pictures as light, and what of them counts
pair_grid      the blocks of a picture, each blurred by one transfer function
plain_blurs    the transfer functions of a Gaussian and of a disc
registration   the shift and scale between the pictures, to a fraction of a pixel
blur_errors    errors of a prediction by block, zone and colour, in codes
distance_facts  what such pictures show of a lens, and the sentence that sums it up
blur_search    the parameter of a blur by least error, on halves of the blocks
"""
