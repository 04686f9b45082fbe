"""Commands of daily use.

    process   captures in, pictures out (`results`: what is printed of each)
    plan      what `process` would do, why, and what it would take (`plan_text`)
    simulate  the digital twin: a scene to a DNG
    merge     a bracket of exposures to one linear EXR
    calibrate what a camera is, measured: its PSF, noise, vignetting; a display
    psf_group/  `camkit psf`: a PSF of other programs
    info      what a bundle, a PSF, a capture or a sidecar is

`decoding_ahead` has the decoder of `process` start first. `mosaic` holds the options of headerless
mosaics, for `process`, `info` and `merge`.
"""
