#!/usr/bin/env bash
# A network cut in two gives other bits where a sum crosses the cut, the same bits elsewhere.
#
# Versions: onnxruntime 1.31.1, onnx 1.23.2, numpy 2.4.6, CPython 3.11 or later, x86-64.
# Valid input: convolution, leaky ReLU, two more convolutions, and the sum of the last with what the
#   first leaky ReLU gave (a residual block); 32 channels, 64x64, made here. The same nodes are run as
#   one model and as two, whose second takes what the first gives.
# Behaviour: convolutions, activations and what lies between them may be parted anywhere. A sum of two
#   tensors in the blocked layout is taken inside the convolution that makes one of them, unless the
#   other comes in from outside: then it is a node of its own and rounds differently, by about one
#   unit in the last place (seen from two blocks of channels on). Who cuts networks for memory or for
#   accelerators and compares bits must not part a sum from either of its sides.
# Output seen:
#   cut before the block: equal False, at most 2e-07 of the largest
#   cut behind the block: equal True, at most 0 of the largest
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install --quiet onnxruntime==1.31.1 onnx==1.23.2 numpy==2.4.6
cat > cut.py <<'PY'
import numpy as np
import onnxruntime as ort
from onnx import TensorProto, helper, numpy_helper

rng = np.random.default_rng(0)
conv = {"pads": [1] * 4, "kernel_shape": [3, 3]}
nodes = [
    helper.make_node("Conv", ["input", "w0"], ["a"], **conv),
    helper.make_node("LeakyRelu", ["a"], ["b"], alpha=0.1),
    helper.make_node("Conv", ["b", "w1"], ["c"], **conv),
    helper.make_node("LeakyRelu", ["c"], ["d"], alpha=0.1),
    helper.make_node("Conv", ["d", "w2"], ["e"], **conv),
    helper.make_node("Add", ["b", "e"], ["sum"]),
    helper.make_node("Conv", ["sum", "w3"], ["output"], **conv),
]
weights = [
    numpy_helper.from_array((0.1 * rng.standard_normal((32, 32, 3, 3))).astype(np.float32), f"w{i}")
    for i in range(4)
]


def run(part, source, target, value):
    ends = [
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, 32, "h", "w"])]
        for name in (source, target)
    ]
    used = {name for node in part for name in node.input}
    graph = helper.make_graph(part, "g", *ends, [w for w in weights if w.name in used])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    session = ort.InferenceSession(
        model.SerializeToString(), options, providers=["CPUExecutionProvider"]
    )
    return session.run([target], {source: value})[0]


value = rng.random((1, 32, 64, 64), dtype=np.float32)
whole = run(nodes, "input", "output", value)
results = {}
for name, place, tensor in (("before", 2, "b"), ("behind", 6, "sum")):
    first = run(nodes[:place], "input", tensor, value)
    results[name] = run(nodes[place:], tensor, "output", first)
    print(f"cut {name} the block: equal {(results[name] == whole).all()}, "
          f"at most {np.abs(results[name] - whole).max() / np.abs(whole).max():.1g} of the largest")
assert not (results["before"] == whole).all() and np.allclose(results["before"], whole, rtol=1e-4, atol=1e-4)
assert (results["behind"] == whole).all()
PY
venv/bin/python cut.py
