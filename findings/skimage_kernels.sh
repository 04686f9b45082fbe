#!/usr/bin/env bash
# scikit-image 0.26.0: two ways in which a right kernel gives a wrong picture, without a word.
#
# 1. restoration.wiener and unsupervised_wiener drop the imaginary part of a transfer function, which
#    their documentation allows in place of the kernel. A symmetric kernel has none, so a box passes;
#    a one-sided one, as of coma or motion, is undone as if half of it lay on either side.
# 2. richardson_lucy with a kernel of even sides (of a PSF in 64x64 or 128x128, say) looks back through
#    it from one pixel beside. It drifts and diverges, though the capture was made by the same
#    convolution as its own. The same kernel with a row and a column of zeros more is restored.
#
# Output seen, dB against the scene:
#   box, Wiener: capture 19.3, from the kernel 26.6, from its transfer function 26.6
#   one-sided, Wiener: capture 23.4, from the kernel 45.9, from its transfer function 24.0
#   one-sided, unsupervised: from the kernel 41.3, from its transfer function 23.9
#   4x4 box, 50 rounds of Richardson-Lucy: capture 19.9, restored 5.7, as 5x5 31.4
#   6x6 box, 50 rounds of Richardson-Lucy: capture 18.4, restored 8.4, as 7x7 23.9
# What the product does: tools/comparison/peers.py hands kernels, and looks back by the conjugate
# of the transfer function, as the product does (runtime/bank/richardson_lucy.py).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --no-compile scikit-image==0.26.0 scipy==1.17.1 numpy==2.4.6
cat > seen.py <<'PY'
import numpy as np
from scipy.signal import convolve2d
from skimage.restoration import richardson_lucy, uft, unsupervised_wiener, wiener

RNG = np.random.default_rng(0)
SCENE = 0.1 + 0.8 * np.kron(RNG.random((16, 16)), np.ones((8, 8)))
RIM = 16


def decibels(picture):
    return f"{-10 * np.log10(np.mean((picture - SCENE) ** 2)):.1f}"


tail = np.zeros((9, 9))
tail[4, 4:] = 0.5 ** np.arange(5)
for name, kernel in (("box", np.ones((5, 5)) / 25), ("one-sided", tail / tail.sum())):
    transfer = uft.ir2tf(kernel, SCENE.shape)
    capture = uft.uirfftn(transfer * uft.urfftn(SCENE), shape=SCENE.shape)
    capture += 1e-3 * RNG.standard_normal(SCENE.shape)
    by_kernel, by_transfer = (
        decibels(wiener(capture, known, 1e-3, clip=False)) for known in (kernel, transfer)
    )
    print(f"{name}, Wiener: capture {decibels(capture)}, from the kernel {by_kernel}, "
          f"from its transfer function {by_transfer}")
by_kernel, by_transfer = (
    decibels(unsupervised_wiener(capture, known, clip=False, rng=0)[0])
    for known in (kernel, transfer)
)
print(f"one-sided, unsupervised: from the kernel {by_kernel}, "
      f"from its transfer function {by_transfer}")

inner = (slice(RIM, -RIM),) * 2
for side in (4, 6):
    restored = []
    for kernel in (np.full((side, side), side**-2.0), np.zeros((side + 1, side + 1))):
        kernel[:side, :side] = side**-2.0
        capture = convolve2d(np.pad(SCENE, RIM, "edge"), kernel, mode="same", boundary="symm")
        restored.append(decibels(richardson_lucy(capture, kernel, num_iter=50, clip=False)[inner]))
    print(f"{side}x{side} box, 50 rounds of Richardson-Lucy: capture {decibels(capture[inner])}, "
          f"restored {restored[0]}, as {side + 1}x{side + 1} {restored[1]}")
PY
venv/bin/python seen.py 2>&1 | tee seen.txt
diff seen.txt - <<'SEEN'
box, Wiener: capture 19.3, from the kernel 26.6, from its transfer function 26.6
one-sided, Wiener: capture 23.4, from the kernel 45.9, from its transfer function 24.0
one-sided, unsupervised: from the kernel 41.3, from its transfer function 23.9
4x4 box, 50 rounds of Richardson-Lucy: capture 19.9, restored 5.7, as 5x5 31.4
6x6 box, 50 rounds of Richardson-Lucy: capture 18.4, restored 8.4, as 7x7 23.9
SEEN
