"""Captures of real cameras against what is known of them, one file each.

claim      what was measured of a capture, beside its aim
face       camkit as a user calls it, on a file and a timing text
panels     pictures side by side
planes     a consumer's sensor of 9 zones before a wall at known distances
tower      a tower 9.8 km away: two halves of the photons against each other
layers     a screen before a figure: two returns against their reference
confocal   light that went around a corner, as transient video
lifetimes  fluorescence: a map of lifetimes, beside flimlib
stream     a photon stream against its decoding by another program
edges      bins of unequal widths: what ignoring them costs
"""
