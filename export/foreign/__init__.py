"""Trained networks of others, from ONNX or a state dict to a bundle; torch only for the latter.

onnx_file        a file decoded: one opset range, weights inside, float32, open sides
draft            its nodes while they are rewritten
folded_values    what does not depend on the picture, found by running it at two sizes
operator_forms   every node in the form that opset 20 and the graph reader know
norms            norms by their parts, so that statistics are means
shuffles, pads   patterns of nodes that one node stands for
transposed       transposed convolutions on the coarse grid
canonical        all of that, and the proof against the original
inspection       every obstacle at once, and what the network costs
contract         what the network takes and gives, as its owner states it
global_statistics  means over the whole picture, frozen or made local
own_pairs        pairs of the owner's own script, held against the contract
wiring           the stages of a bundle that follow from the contract
adding           everything packed, proved, written
published, state_dict  a file of torch, exported first
doors            `camkit.export.inspect_network`, `add_network`, and `camkit network`
"""
