#!/usr/bin/env bash
# onnxruntime's CPU arena holds 1.5 to 3 times the tensors that a U-Net needs at one time.
#
# Versions: onnxruntime 1.24.1, onnx 1.19.1, numpy 2.3.5, CPython 3.11 or later, Linux with glibc.
# Valid input: a U-Net of three levels, 16 channels at full size, window 768x768, made here.
# Behaviour: with the arena (the default) the peak of the process rises by about 2.3 times what the
#   tensors need that are alive together, because tensors of many sizes leave holes. Without the
#   arena, with memory patterns and arrays that glibc maps one by one, it rises by about 1.2 times.
#   A cap computed from live tensors does not hold with the default.
# Output seen:
#   arena    rose by 338 MB
#   pattern  rose by 177 MB
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install --quiet onnxruntime==1.24.1 onnx==1.19.1 numpy==2.3.5
cat > rise.py <<'PY'
import sys

import numpy as np
import onnxruntime as ort
from onnx import TensorProto, helper, numpy_helper

rng = np.random.default_rng(0)
nodes, weights = [], []


def add(op, *inputs, **facts):
    name = f"t{len(nodes)}"
    nodes.append(helper.make_node(op, list(inputs), [name], **facts))
    return name


def constant(*shape):
    values = (0.1 * rng.standard_normal(shape)).astype(np.float32)
    weights.append(numpy_helper.from_array(values, f"w{len(weights)}"))
    return weights[-1].name


def block(at, before, after):
    for count in (before, after):
        at = add("Relu", add("Conv", at, constant(after, count, 3, 3), pads=[1] * 4))
    return at


at, skips = "input", []
for before, after in ((6, 16), (16, 32)):
    skips.append(block(at, before, after))
    at = add("MaxPool", skips[-1], kernel_shape=[2, 2], strides=[2, 2])
at = block(at, 32, 64)
for before, after in ((64, 32), (32, 16)):
    up = add("ConvTranspose", at, constant(before, after, 2, 2), strides=[2, 2])
    at = block(add("Concat", up, skips.pop(), axis=1), 2 * after, after)
nodes.append(helper.make_node("Conv", [at, constant(3, 16, 1, 1)], ["output"]))
ends = [
    [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, count, "h", "w"])]
    for name, count in (("input", 6), ("output", 3))
]
graph = helper.make_graph(nodes, "unet", *ends, weights)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
options = ort.SessionOptions()
options.intra_op_num_threads = 1
options.enable_cpu_mem_arena = sys.argv[1] == "arena"
options.enable_mem_pattern = sys.argv[1] == "pattern"
session = ort.InferenceSession(
    model.SerializeToString(), options, providers=["CPUExecutionProvider"]
)
window = np.ones((1, 6, 768, 768), np.float32)


def peak_mb():
    status = open("/proc/self/status").read()
    return int(status.split("VmHWM:")[1].split()[0]) * 1024 / 1e6


before = peak_mb()
for _ in range(3):
    session.run(None, {"input": window})
print(f"{peak_mb() - before:.0f}")
PY
arena=$(venv/bin/python rise.py arena)
pattern=$(MALLOC_MMAP_THRESHOLD_=262144 venv/bin/python rise.py pattern)
echo "arena    rose by $arena MB"
echo "pattern  rose by $pattern MB"
if ((2 * arena < 3 * pattern)); then
    echo "the arena takes less than 1.5 times the block: the behaviour changed" >&2
    exit 1
fi
