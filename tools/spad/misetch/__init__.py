"""A plate that was etched wrong: what an array sees of it, what is measured, what that wins back.

plate       the plate as designed, etched by masks that are all wrong by a share, and its PSF
photograph  the dots of a point on a fine sensor, a bracket of them, the PSF measured on it
tuning      a network trained on for some CPU-minutes, behind the PSF that was measured
scores      networks and linear estimates on the test sets, whatever they were told of the PSF
judging     all of it for the plate as designed, plates as etched, and a scan of errors
text        the record as tables
"""
