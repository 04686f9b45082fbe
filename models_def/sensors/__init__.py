"""The sensor and the front end in torch; each has a twin in the runtime (tests/parity).

    forward     blur by one kernel, or by one a block
    demosaic    mosaic to planes
    psf         the kernel of an image point
    wiener      the Wiener filter of a patch
    stabilise   the transform around the network
    tone        the sRGB curve, for losses on what a display shows

All take batches and hand gradients on.
"""
