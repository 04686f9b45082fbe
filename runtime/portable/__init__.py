"""A camera as ONNX graphs, for programs without camkit: `camkit portable`.

facts          what of a bundle has graphs; cameras without are refused
refusal        the refusal of a camera, by the name of what has no graph
graph_builder  values that add and multiply become nodes; tables that graphs share
spectra        spectra of blocks as products of matrices
place          what the filter of a block knows of its place
demosaic_taps  light, white balance and demosaic as one convolution
taper          the ring of a block blended to its own blur
block_noise    noise and level of a block
light_graph    clipped light explained
mosaic_filter  the filter on the samples of the mosaic
cell_waves     spectra of pictures in coarse cells
haze_graph     a haze found in coarse cells, and cleared
block          all of that: one block
frames_graph   pictures of an array of single photons
tile           the network and what lies behind it
warp_graph     where output pixels come from, and the pixels
folder         files in a folder or a zip, all or none
package        graphs, tables and manifest in a folder
"""
