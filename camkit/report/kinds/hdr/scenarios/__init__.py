"""Scenarios of snapshot HDR cameras; each module defines `SCENARIO`.

peak, single_colour                            the lights are of another kind
saturated_area, blob_size                      they are many, or large
streak_clipping, streak_like_edges             their streaks are hidden, or look like the scene
light_outside                                  they lie beside the picture
plate_rotation, wrong_depth                    streaks lie elsewhere than the bundle says
bit_depth, noise                               the sensor is a worse one

All are judged by `camkit.report.kinds.hdr.judge`: a method that ends more than half a decibel
below the developed picture of the bare lens, at less than 65 dB, breaks.
"""
