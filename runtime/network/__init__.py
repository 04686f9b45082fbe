"""Networks on the CPU: read, run, tiled exactly, measured.

operators, graph_walk   what a tensor depends on, by walking the graph
graph                   the only door to onnx: refusals and facts
engine                  the only door to onnxruntime: one session per model, or per segment
openvino_session        the only door to openvino, an extra: float32 or bfloat16
tiling, row_buffer      windows over a picture with the bits of the whole
guard                   every tile finite and bounded, else replaced or refused
light_bound, light_keeper  light that a network moves, taken back behind every window
white_keeper            no lamp ends below white, in the colours of the output either
cell_windows            networks on some lattice cells only, the bits there unchanged
segment, graph_cuts     a network in parts that each reach a few rows
row_network             these over a large picture in strips of rows, nothing computed twice
windows                 one of the three, within the memory cap
activation_memory       what one window takes
probe, ranges           reach, halo error and activations, found by running
"""
