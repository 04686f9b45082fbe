"""The sensor and the front end in torch, where gradients are needed: twins of the runtime's.

    forward     blur by one kernel, or by one a block
    exposure    photons, read noise, clipping, digital numbers
    demosaic    mosaic to planes
    turned_kernels   kernels turned to their azimuth
    wiener      the Wiener filter of a patch
    together    the same for all colours at once
    stabilise   the transform around the network
    tone        the sRGB curve, for losses on what a display shows

All take batches and hand gradients on; `tests/parity` holds the twins together.
"""
