"""The blur of a lens over the field, from edges in ordinary photographs.

photo_edges    straight, isolated steps in a photograph, and the samples of each colour across them
blob_basis     kernels as sums of round blobs, and how light rises across an edge behind each
edge_fit       one edge explained by kernels: its place, dark and bright, how sharp it is
sharp_edges    which edges are as sharp as the lens, by direction and distance from the axis
kernel_solve   blobs that are not negative, from the edges of all places together
photo_blur     the whole measurement: photographs to a PSF
blur_facts     the result, what held-out edges say of it, what is not determined
"""
