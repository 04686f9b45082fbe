"""Networks on the CPU: read, run, tiled exactly, measured.

operators, graph_walk   what a tensor depends on, by walking the graph
graph                   the only door to onnx: refusals and facts
engine                  the only door to onnxruntime: one session per model
tiling                  windows over a picture with the bits of the whole
probe, ranges           reach, halo error and activations, found by running
"""
