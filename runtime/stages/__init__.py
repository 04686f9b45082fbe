"""The stages of a bundle: one module each, found by the name of the stage.

See `camkit.runtime.job.stage_work` for what a module defines, and `camkit.bundle.stages` for what a
manifest says of a stage.

linearise, repair, white_balance, demosaic     the front
haze, wiener, network                          the restoration
raise_clipped, illumination, undistort, color  what every picture needs behind it
"""
