"""The networks of Sun 2021, chapter 5, built row by row from its tables; references, never shipped.

    capture I_s -- splitting -- I_U ------------------.
                            '-- I_r -- highlight -- I_S (masked) -- fusion -- I_F

    layers       what they are made of
    splitting    table 5.1: VGG-19 hypercolumn of 1475 channels, dilated convolutions
    highlight    table 5.2: U-Net from the streaks to the lights
    fusion       table 5.3: both put together
    chain        the three in a row, eqs. (5.3) to (5.5)

All take and give linear light, 1.0 = white. Instance norms look at the whole picture, so none but
the fusion is exact under tiling, and none is exported.
"""
