"""Lights read back from the streaks that optics write beside them (`camkit.streaks`).

    cells        a capture, or a kernel, in cells of 2 x 2 samples, and of 4 x 4
    cell_rows    pixels from cells, linear between their middles
    kernels      dense kernels as cells see them: what is core, what is veil
    convolution  light spread by a kernel, and back
    regions      clipped cells that throw light on the same samples, in one window
    shapes       lights of coarse cells as lights of finer ones
    descent      the light of clipped cells that explains what lies around them
    refinement   the same in finer cells, each group of neighbours near itself
    light_evidence     how much of a light the picture proves
    spots        lights of cells shared out over the pixels that clipped
    streak_rows  streaks of lights, over rows of pixels
    recovery     all of it: cells -> lights, their streaks, the veil of everything else
    doubt        samples without streaks, believed as far as these are known
    rims         colours within and beside lights
    painting     lights put into the rows of a picture, veil and streaks taken out

Numpy and scipy alone: the training side makes its samples with the code that runs at use time.
"""
