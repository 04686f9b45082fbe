"""The digital twin of a bundle's array: sharp scenes to counts, histograms and their files.

scene        pictures, depth and albedo, light in flight: the light of sub-pixels and time bins
array        what of it every pixel sees, through the plate, at its own sub-pixel
counting     photons of it: Poisson, dark counts, hot pixels, blind times
working      the working points of the prototype
recording    how much light there is, and what is recorded of it
photon_twin  all of it as a bundle asks for it
laws         laws of its pictures: even scenes stay even, no black where light was counted
write        files that `camkit process` reads
"""
