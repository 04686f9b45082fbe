"""Develops golden captures of camkit bundles, written from the format pages alone."""
import json
import sys
import zipfile
from types import SimpleNamespace

import numpy as np
import onnxruntime
from scipy import ndimage
from scipy.fft import fft2, ifft2, next_fast_len

AXES, ROOT, HALF = (-2, -1), 2 ** 0.5, 0.5 ** 0.5
PLANES = np.array([0, 1, 1, 2])  # the colours of R, sum and difference of the greens, B
MIX = np.array([[1, 0, 0, 0], [0, HALF, HALF, 0], [0, HALF, -HALF, 0], [0, 0, 0, 1]])
SIGNS = np.array([[1, 1, 1, 1], [ROOT, 0, 0, -ROOT], [0, -ROOT, ROOT, 0], [1, -1, -1, 1]])
COVERED = {"demosaic": {"method": "fast"},
           "wiener": {"depth": "mean", "clip_windows": "half_kernel", "clip_reach_px": 16},
           "network": {"transform": "stabilise", "lights_px": None, "keeps_white": False},
           "undistort": {"interpolation": "cubic", "overshoot": "limited"}}
KERNELS = {name: np.reshape(text.split(), (5, 5)).astype(float) for name, text in {
    "green": "0 0 -1 0 0   0 0 2 0 0   -1 2 4 2 -1   0 0 2 0 0   0 0 -1 0 0",
    "row": "0 0 .5 0 0   0 -1 0 -1 0   -1 4 5 4 -1   0 -1 0 -1 0   0 0 .5 0 0",
    "column": "0 0 -1 0 0   0 -1 4 -1 0   .5 0 5 0 .5   0 -1 4 -1 0   0 0 -1 0 0",
    "diagonal": "0 0 -1.5 0 0   0 2 0 2 0   -1.5 0 6 0 -1.5   0 2 0 2 0   0 0 -1.5 0 0",
    "rise": "0 -.5 0 -.5 0   -.5 0 1 0 -.5   0 1 0 1 0   -.5 0 1 0 -.5   0 -.5 0 -.5 0"}.items()}

def read_tensors(data):
    """All tensors of a safetensors file, by name."""
    start = 8 + int.from_bytes(data[:8], "little")
    kinds = {"F16": "<f2", "F32": "<f4", "F64": "<f8", "U16": "<u2", "U8": "u1"}
    return {name: np.frombuffer(data[slice(*(start + at for at in entry["data_offsets"]))],
                                kinds[entry["dtype"]]).reshape(entry["shape"])
            for name, entry in json.loads(data[8:start]).items() if name != "__metadata__"}
def open_case(path, case_name, size):
    """A camera that this reader covers, as it is in a golden case; others are refused by name."""
    bundle = zipfile.ZipFile(path)
    camera = SimpleNamespace(archive=bundle, size=size, **json.loads(bundle.read("manifest.json")))
    strange = [stage["type"] for stage in camera.stages if stage["type"] not in STAGES
               or not COVERED.get(stage["type"], {}).items() <= stage.items()]
    if strange or (camera.optics["type"], camera.optics["symmetry"]) != ("frozen_psf", "radial"):
        raise SystemExit(f"{camera.name} is not covered: {strange or camera.optics['type']}")
    camera.case = case = next(case for case in camera.golden if case["name"] == case_name)
    camera.tensors = read_tensors(bundle.read("golden.safetensors"))
    camera.psf = read_tensors(bundle.read(camera.optics["member"]))
    extent, (left, top) = camera.sensor["extent"], case["origin_px"]
    middle = [(extent[side] - 1) / 2 for side in ("width_px", "height_px")]
    camera.corner = np.subtract((left, top), extent["optical_centre_px"] or middle)
    camera.pitch, camera.gains = extent["pixel_pitch_um"] / 1000, np.array(case["white_balance"])
    camera.planes = {"capture": camera.tensors[case_name + ".capture"]}
    rows, columns = np.indices(camera.planes["capture"].shape)
    cfa = np.array(["RGB".index(letter) for letter in camera.sensor["cfa"]])
    camera.colours = cfa[2 * ((top + rows) % 2) + (left + columns) % 2]
    camera.shot, camera.read = noise_at(camera, case["iso"])
    return camera
def place_mm(camera, x, y):
    """Millimetres from the axis of a pixel of the capture."""
    return (x + camera.corner[0]) * camera.pitch, (y + camera.corner[1]) * camera.pitch
def noise_at(camera, iso):
    """Shot noise, and the variance of reading, of every colour behind white balance."""
    isos, gains, reads = ([entry[key] for entry in camera.sensor["noise"]]
                          for key in ("iso", "gain_e_per_dn", "read_noise_e"))
    level = np.log(np.clip(iso, isos[0], isos[-1]))
    gain = np.exp(np.interp(level, np.log(isos), np.log(gains)) - max(np.log(iso / isos[-1]), 0))
    shot = camera.gains / (gain * (camera.sensor["white_level"] - camera.sensor["black_level"]))
    return shot, (np.interp(level, np.log(isos), reads) * shot) ** 2

def linearise(camera, stage, capture):
    """Light of a mosaic in DN, and what clipped."""
    black, white = camera.sensor["black_level"], camera.sensor["white_level"]
    light = ((capture - black) / (white - black)).astype(np.float32)
    return light, capture >= np.ceil(black + 0.99 * (white - black))
def repair(camera, stage, light, clipped):
    """Lone samples become the median of their neighbours."""
    (height, width), wide = light.shape, np.pad(light, 2, "reflect")
    around = np.stack([wide[y:y + height, x:x + width] for y in (0, 2, 4) for x in (0, 2, 4)
                       if (y, x) != (2, 2)])
    high, low, middle = around.max(0), around.min(0), np.median(around, 0)
    limit, excess = 2 * (high - low) + np.float32(0.02), light - middle
    rise = ndimage.convolve(light, KERNELS["rise"], mode="mirror")
    broken = ((light > high + limit) | (light < low - limit)) & (
        rise * np.sign(excess) <= 0.1 * abs(excess))
    return np.where(broken, middle, light), clipped & ~broken
def white_balance(camera, stage, light):
    """Every sample times the gain of its colour."""
    return (light * camera.gains[camera.colours].astype(np.float32),)
def demosaic(camera, stage, light):
    """Three planes of a mosaic, after Malvar, He and Cutler."""
    planes, near = [], {name: ndimage.convolve(light, kernel / 8, mode="mirror")
                        for name, kernel in KERNELS.items()}
    for colour in range(3):
        here = camera.colours == colour
        beside = np.where(here.any(1)[:, None], near["row"], near["column"])
        other = np.where(camera.colours == 1, beside, near["diagonal"])
        planes.append(np.where(here, light, near["green"] if colour == 1 else other))
    return (np.stack(planes),)

def colour_kernels(camera):
    """Kernels of the colours, of the mean depth: (field, colour, row, column)."""
    waves, curve = camera.psf["wavelengths_um"], camera.sensor["channel_response"]
    knots = np.union1d(curve["wavelengths_um"], waves)
    half = np.diff(knots) / 2
    points = np.concatenate([knots[:-1] + half * (1 + sign / 3 ** 0.5) for sign in (-1, 1)])
    hats = [np.interp(points, waves, row) for row in np.eye(len(waves))]
    curves = [np.interp(points, curve["wavelengths_um"], row, 0, 0) for row in curve["response"]]
    weights = np.array(curves) * np.tile(half, 2) @ np.transpose(hats)
    kernels = np.einsum("cn,fnyx->fcyx", weights, camera.psf["kernels"].mean(1), optimize=True)
    kernels = kernels + kernels[..., ::-1]
    return kernels / kernels.sum(AXES, keepdims=True)
def resample(plane, rows, columns, a):
    """Values of a plane at positions by a cubic, and the 4x4 samples behind each."""
    def taps(t):
        far = [((a * u - 5 * a) * u + 8 * a) * u - 4 * a for u in (t + 1, 2 - t)]
        near = [((a + 2) * u - (a + 3)) * u ** 2 + 1 for u in (t, 1 - t)]
        return np.stack([far[0], *near, far[1]])
    at, steps = np.floor([rows, columns]).astype(int), np.arange(-1, 3)[:, None, None]
    around = plane[np.clip(at[0] + steps, 0, plane.shape[0] - 1)[:, None],
                   np.clip(at[1] + steps, 0, plane.shape[1] - 1)]
    return np.einsum("ijyx,iyx,jyx->yx", around, taps(rows - at[0]), taps(columns - at[1])), around
def between(values, heights, height):
    """Values at a height, linear between those at the heights, constant beyond."""
    part = np.interp(height, heights, np.arange(len(heights)))
    low = min(int(part), len(heights) - 2)
    return values[low] + (part - low) * (values[low + 1] - values[low])
def place_kernels(kernels, heights, x, y):
    """Kernels of the colours at a place with x, y >= 0, from those of all fields."""
    radius, half = np.hypot(x, y), kernels.shape[-1] // 2
    here = between(kernels, heights, radius)
    if x:
        down, right = np.indices(here.shape[1:]) - half
        at = np.stack([right * x + down * y, right * y - down * x]) / radius + half + 2
        here = [resample(np.pad(plane, 2), *at, -0.5)[0] for plane in here]
    return np.maximum(here, 0) / np.maximum(here, 0).sum(AXES, keepdims=True)
def filtered(transfer, planes):
    """Planes blurred by a transfer."""
    return ifft2(transfer * fft2(planes)).real

def wiener(camera, stage, planes, mask):
    """Blocks deconvolved at their places, added with windows."""
    kernels, overlap = colour_kernels(camera), stage["overlap_px"]
    fast = next_fast_len(max(mask.shape) + 2 * (7 * overlap // 16) + 4, real=True)
    side = max(min(stage["block_px"], max(-(-fast // 4) * 4, 512, 2 * overlap)), kernels.shape[-1])
    planes = np.concatenate([planes, mask[None]]).astype(float)
    wide = np.pad(planes, ((0, 0), (side, side), (side, side)), "reflect")
    result, red = np.zeros(wide[:3].shape), np.argwhere(camera.colours == 0)[0]
    for top, down, middle_y in axis_blocks(mask.shape[0], side, overlap):
        for left, right, middle_x in axis_blocks(mask.shape[1], side, overlap):
            x, y = place_mm(camera, middle_x, middle_y)
            flip = np.s_[:, ::-1 if y < 0 else 1, ::-1 if x < 0 else 1]
            cut = np.s_[:, top + side:top + 2 * side, left + side:left + 2 * side]
            here = place_kernels(kernels, camera.psf["field_heights_mm"], abs(x), abs(y))
            phase = ((red[0] - top + (y < 0)) % 2, (red[1] - left + (x < 0)) % 2)
            *block, clipped = wide[cut][flip]
            done = restore(camera, stage, np.stack(block), clipped > 0, here, np.hypot(x, y), phase)
            result[cut] += done[flip] * down[:, None] * right
    return (result[:, side:-side, side:-side],)
def axis_blocks(count, side, overlap):
    """First sample, window and middle of every block along an axis."""
    number = max(1, -(-(count + 2 * (7 * overlap // 16) - overlap) // (side - overlap)))
    ramp = np.clip((np.arange(side) + 0.5 - overlap / 4) / (overlap / 2), 0, 1)
    rise, flat = np.sin(np.pi / 2 * ramp) ** 2, np.ones(side)
    for index in range(number):
        start = index * (side - overlap) - (number * (side - overlap) + overlap - count) // 2
        window = (rise if index else flat) * (rise[::-1] if index < number - 1 else flat)
        live = np.clip(np.flatnonzero(window)[[0, -1]] + start, 0, count - 1)
        yield start, window, live.mean()
def taper(block, transfer, ring):
    """A block, of side 4 n, blended at its rim to its own periodic blur."""
    side, few = block.shape[-1], block.shape[-1] // 4
    lowest = np.r_[0:(few + 1) // 2, side - few // 2:side]
    small = block.reshape(-1, few, 4, few, 4).mean((2, 4))
    blur = filtered(transfer[:, lowest[:, None], lowest], small).repeat(4, 1).repeat(4, 2)
    near = np.minimum(np.arange(side), np.arange(side)[::-1])
    line = np.where(near < ring, np.sin(np.pi / 2 * (near + 0.5) / ring) ** 2, 1)
    return blur + (block - blur) * line[:, None] * line
def restore(camera, stage, block, clipped, kernels, height, phase):
    """One block, deconvolved."""
    side, half, mosaic = block.shape[-1], kernels.shape[-1] // 2, stage.get("mosaic")
    from_samples = mosaic and side % 2 == 0 and height <= mosaic["within_mm"]
    laid = np.pad(kernels, ((0, 0), *[(0, side - 2 * half - 1)] * 2))
    transfer = fft2(np.roll(laid, (-half, -half), AXES))
    block = taper(block, transfer, min(stage["overlap_px"], side) // 4)
    lowest = noise_at(camera, camera.sensor["noise"][0]["iso"])
    shot, read = np.maximum(camera.shot, lowest[0]), np.maximum(camera.read, lowest[1])
    level, lights = np.maximum(block.mean(AXES), 0), 0
    size, variance = np.sqrt(np.maximum(np.maximum(level ** 2, read), 1e-12)), shot * level + read
    if clipped.any() and stage["clip_iterations"]:
        unknown, offset = ndimage.maximum_filter(clipped, 5), read / np.maximum(shot, 1e-12)
        lights, left = explain(stage, block, clipped, unknown, transfer, offset, half)
        variance, rest = np.maximum(variance, left), block - filtered(transfer, lights)
        block = np.where(clipped if from_samples else unknown, 0, rest)
    numbers, f2 = stage["together"], np.add.outer(*[np.fft.fftfreq(side) ** 2] * 2)
    signal, share = numbers["scale"] * size.mean() ** 2, np.maximum(size / size.mean(), 0.001)
    table = numbers["spread"]
    spread = between(np.array(table["variance"]), table["heights_mm"], height)
    spread = np.stack([np.interp(np.sqrt(f2), table["frequencies"], row) for row in spread])
    known = SimpleNamespace(
        **numbers, f2=f2, transfer=transfer, doubt=numbers["mistrust"] * spread, signal=signal,
        share=share[:, None, None], noise_share=(variance / share ** 2 / signal)[:, None, None],
        prior=side ** 2 * (f2 + 1 / 512 ** 2) ** (-numbers["exponent"] / 2))
    spectrum = by_samples(block, known, phase, mosaic) if from_samples else by_planes(block, known)
    return lights + ifft2(spectrum).real
def ratio_of(found, expected):
    """The ratio of what a block shows to what is expected of it."""
    return max(found.sum() / expected.sum(), 1e-6) if expected.sum() > 0 else 1
def by_planes(block, known):
    """Spectra of the colours, restored together from three planes."""
    side, spectrum, prior = block.shape[-1], fft2(block), known.prior
    rise, power = np.reshape(known.noise_rise, (3, 1, 1)), abs(known.transfer) ** 2
    noise = side ** 2 * np.exp(np.reshape(known.noise, (3, 1, 1)) + 4 * rise * known.f2)
    def solve(factor):
        below = (known.own * power + known.doubt) * prior + factor * known.noise_share * noise
        lone, seen = known.transfer.conj() * spectrum / below, power * prior / below
        return prior / (1 + seen.sum(0)) * (lone / known.share).sum(0), lone, seen
    first, _, seen = solve(1)
    expected = known.signal * prior * seen.sum(0) / (1 + seen.sum(0))
    third, band = np.s_[::3, :side // 2 + 1:3], (known.f2 >= 0.015 ** 2) & (known.f2 <= 0.25 ** 2)
    ratio = ratio_of((band * abs(first) ** 2)[third], (band * expected)[third])
    light, lone, seen = solve(ratio ** -known.follow)
    result = known.share * (1 - known.own * seen) * light + known.own * prior * lone
    result[:, 0, 0] = spectrum[:, 0, 0]
    return result
def by_samples(block, known, phase, mosaic):
    """Spectra of the colours, from a mosaic's samples; arrays are (row, column, plane, alias)."""
    side, half, cells = block.shape[-1], block.shape[-1] // 2, ((0, 0), (0, 1), (1, 0), (1, 1))
    number = np.round(np.fft.fftfreq(half, 1 / half)).astype(int)
    at = [np.ix_((number + half * y) % side, (number + half * x) % side) for y, x in cells]
    places = [((phase[0] + down) % 2, (phase[1] + right) % 2) for down, right in cells]
    samples = np.stack([block[colour, y::2, x::2] for colour, (y, x) in zip(PLANES, places)])
    turn = [np.exp(-1j * np.pi / half * np.add.outer(y * number, x * number)) for y, x in places]
    seen = (fft2(samples) * turn / known.share[PLANES]).transpose(1, 2, 0) @ MIX
    seen[0, 0, [0, 1, 3]] = 0
    blur, doubt, prior = (np.stack([values.transpose(1, 2, 0)[here] for here in at], -1) for values
                          in (known.transfer[PLANES], known.doubt[PLANES], known.prior[None]))
    blur, same = SIGNS / 4 * blur, PLANES[:, None] == PLANES
    matrix = (blur * prior) @ blur.conj().swapaxes(2, 3) * (1 + known.own * same)
    matrix = matrix + (SIGNS / 16 * prior * doubt) @ SIGNS.T * same
    def solve(factor, right):
        full = matrix + np.diag(half ** 2 * factor * known.noise_share[PLANES, 0, 0])
        return np.linalg.solve(full, right[..., None])
    low, answer, f2 = blur[..., :1], solve(1, blur[..., 0]), known.f2[at[0]]
    weight = np.where((f2 >= 0.06 ** 2) & (f2 < 0.25 ** 2), prior[..., 0, 0] ** 2, 0)
    ratio = ratio_of(weight * abs((answer[..., 0].conj() * seen).sum(2)) ** 2,
                     weight * known.signal * (low.conj() * answer).sum((2, 3)).real)
    smooth = max(1, mosaic["smooth_below"] / ratio) ** mosaic["smooth_follow"]
    parts = blur.conj() * solve(smooth / ratio ** known.follow, seen) * prior
    parts = np.stack([parts[:, :, PLANES == colour].sum(2) for colour in range(3)])
    parts, result = known.own * parts + parts.sum(0), np.zeros(block.shape, complex)
    for alias, (down, right) in enumerate(cells):
        sign = (-1) ** (phase[0] * down + phase[1] * right)
        result[:, *at[alias]] = sign * known.share * parts[..., alias]
    result[:, 0, 0] = [samples[PLANES == colour].mean() * side ** 2 for colour in range(3)]
    return result
def explain(stage, block, clipped, unknown, transfer, offset, kernel_half):
    """Light about clipped samples, and the variance that it leaves unexplained."""
    side, lights, left, weights = len(clipped), np.zeros(block.shape), 0, np.zeros(clipped.shape)
    size, windows = choose_windows(clipped, kernel_half, stage.get("whole_blocks", False))
    for top, first, own in windows:
        cut = np.s_[..., top:top + size, first:first + size]
        here = transfer[:, ::side // size, ::side // size]
        samples = taper(block[cut], here, 8) if size < side else block
        light = richardson_lucy(stage, samples, unknown[cut], here, offset[:, None, None])
        part = 2 - 2 * ndimage.distance_transform_edt(~own[cut]) / stage["clip_reach_px"]
        near = np.clip(part, 0, 1) ** 2 * (3 - 2 * np.clip(part, 0, 1))
        rest = np.where(unknown[cut], 0, samples - filtered(here, light))
        left = left + (rest ** 2 * near).sum(AXES) / side ** 2
        lights[cut] += light * near
        weights[cut] += near
    return lights / np.maximum(weights, 1), left
def richardson_lucy(stage, samples, unknown, transfer, offset):
    """The light that explains periodic samples."""
    measured, mean = np.maximum(samples + offset, 1e-6), samples.mean(AXES, keepdims=True)
    light = np.maximum(samples, np.maximum(0.1 * mean, 1e-6))
    for _ in range(stage["clip_iterations"]):
        ratio = measured / np.maximum(np.maximum(filtered(transfer, light), 0) + offset, 1e-6)
        ratio = np.where(unknown, np.maximum(ratio, 1), ratio)
        light = light * np.maximum(filtered(transfer.conj(), ratio), 0) ** stage["clip_power"]
    return light
def choose_windows(clipped, kernel_half, whole):
    """Side and places of windows, each with clipped samples of its own; or the whole block."""
    side, least, best = len(clipped), clipped.size, (len(clipped), [(0, 0, clipped)])
    for parts in () if whole else (4, 3, 2):
        size, core = side // parts, side // parts - 40
        if side % parts or size % 4 or core < 1 or size < kernel_half + 0.5:
            continue
        windows, uncovered = [], clipped.copy()
        while uncovered.any():
            row = int(uncovered.any(1).argmax())
            column = int(uncovered[row:row + core].any(0).argmax())
            own, square = np.zeros_like(clipped), np.s_[row:row + core, column:column + core]
            own[square], uncovered[square] = uncovered[square], False
            windows.append((*(min(max(at - 20, 0), side - size) for at in (row, column)), own))
        if len(windows) * (size ** 2 + 64 ** 2) < least:
            least, best = len(windows) * (size ** 2 + 64 ** 2), (size, windows)
    return best

def network(camera, stage, *planes):
    """The network of the chosen size, with a bound on what it adds to its last plane."""
    facts, (*taken, mask) = camera.networks[stage["role"]][camera.size], planes
    scale, reads = stage["scale"], [entry["read_noise_e"] for entry in camera.sensor["noise"]]
    shot = np.maximum(camera.shot, np.sqrt(camera.read) / max(3 * max(reads), 1))[:, None, None]
    rest = np.maximum(camera.read[:, None, None], (min(reads) * shot) ** 2) / shot ** 2
    def stabilise(light):
        return np.sqrt(np.maximum(light / shot + rest, 0)) / scale
    edges = [(0, -count % facts["stride_px"]) for count in mask.shape]
    taken = [np.pad(stabilise(plane), ((0, 0), *edges), "edge") for plane in taken]
    session = onnxruntime.InferenceSession(camera.archive.read(facts["member"]))
    given = session.run(None, {facts["input_name"]: np.float32([np.concatenate(taken)])})[0][0]
    keep = 1 - sum(ndimage.maximum_filter(mask, side) / 2.0 for side in (7, 11))
    given = bound_light(stage["light"], scale, taken[-1], np.maximum(given.astype(float), 0),
                        np.pad(keep, edges, "edge"), stabilise(0.8))
    light = shot * ((np.maximum(given, 0) * scale) ** 2 - rest)
    return (light[:, :mask.shape[0], :mask.shape[1]],)
def bound_light(numbers, scale, last, given, keep, bright):
    """Bounds the light that a network adds to its last plane."""
    def cells(planes):
        return planes.reshape(3, len(keep) // 4, 4, -1, 4).mean((2, 4))
    def smooth(planes):
        return ndimage.convolve(planes, np.outer([1, 2, 1], [1, 2, 1])[None] / 16, mode="nearest")
    change = smooth(cells((given - last) * (given + last) * keep))
    change /= np.maximum(smooth(cells((given + last) * keep)), 1e-6)
    mean, noise = smooth(cells(last)), (0.5 / scale / 4) ** 2
    spread = np.maximum(smooth(cells(last) ** 2) - mean ** 2, 0)
    limit = np.sqrt(numbers["noise"] ** 2 * noise * 9 / 64 + (numbers["light"] * mean / 2) ** 2
                    + numbers["spread"] ** 2 * np.maximum(spread - 4 * noise, 0))
    at = (np.indices(keep.shape) + 0.5) / 4 - 0.5
    given = given - [ndimage.map_coordinates(plane, at, order=1, mode="nearest")
                     for plane in change - np.clip(change, -limit, limit)]
    given = last + (given - last) * keep
    share = np.clip(((last / bright).min(0) - 0.7) / 0.3, 0, 1)
    return np.maximum(given, share * last - 4 / scale) if numbers.get("keeps_bright") else given
def raise_clipped(camera, stage, planes):
    """Clipped light made neutral."""
    gains = camera.gains[:, None, None]
    share = np.clip((planes - 0.90 * gains) / (0.09 * gains), 0, 1)
    raised = planes + share * (planes.max(0) - planes)
    return (planes + np.maximum(share * ((raised.sum(0) - raised) / 2 - planes), 0),)
def illumination(camera, stage, planes):
    """Divided by the relative illumination."""
    x, y = place_mm(camera, *np.indices(planes.shape[1:])[::-1])
    return (planes / np.interp(x ** 2 + y ** 2, camera.psf["field_heights_mm"] ** 2,
                               camera.psf["relative_illumination"]),)
def undistort(camera, stage, planes):
    """The picture in ideal geometry."""
    (height, width), unit = planes.shape[1:], camera.psf["distortion_radius_mm"][0]
    curves = [np.polynomial.Polynomial(np.insert(row, range(4), 0))
              for row in camera.psf["distortion_coefficients"]]
    middle = np.array(place_mm(camera, (width - 1) / 2, (height - 1) / 2))
    radius = wanted = np.hypot(*middle) / unit
    for _ in range(20):
        radius -= (curves[1](radius) - wanted) / curves[1].deriv()(radius)
    shift = middle * (radius / wanted - 1) if wanted else np.zeros(2)
    nodes = [8 * np.arange(-1, count // 8 + 2) + 3.5 for count in (width, height)]
    places = np.stack(place_mm(camera, *np.meshgrid(*nodes))) + shift[:, None, None]
    result, radius = [], np.maximum(np.hypot(*places) / unit, 1e-12)
    for plane, curve in zip(planes, curves):
        at = places * curve(radius) / radius / camera.pitch - camera.corner[:, None, None]
        columns, rows = fine_positions(at, height, width, stage.get("places") == "fixed")
        values, around = resample(plane, rows, columns, -0.75)
        inside = resample(plane, np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1), 0)[1]
        mixed = (inside > 1).any((0, 1)) & (inside <= 1).any((0, 1))
        limited = np.clip(values, around.min((0, 1)), around.max((0, 1)))
        result.append(np.where(mixed | (values < -0.02), limited, values))
    return (np.stack(result),)
def fine_positions(nodes, height, width, fixed):
    """Positions of all pixels, from those of nodes 8 px apart: fixed ones exactly."""
    values = np.floor(nodes * 256 + 0.5) / 256 if fixed else nodes.astype(np.float32)
    for count in (width, height):
        at = (np.arange(count) - 3.5) / 8 + 1
        low, part = at.astype(int), (at % 1).astype(np.float32)
        values = (values[..., low] * (1 - part) + values[..., low + 1] * part).swapaxes(1, 2)
    return (np.floor(values * 32 + 0.5) if fixed else np.round(values * 32)) / 32
def color(camera, stage, planes):
    """The picture in linear Rec.709."""
    primaries = np.array([[0.640, 0.300, 0.150], [0.330, 0.600, 0.060], [0.030, 0.100, 0.790]])
    white = np.array([0.3127, 0.3290, 0.3583]) / 0.3290
    raw = camera.sensor["color_matrix"] @ (primaries * np.linalg.solve(primaries, white))
    return (np.tensordot(np.linalg.inv(raw / raw.sum(1, keepdims=True)), planes, 1),)
STAGES = {stage.__name__: stage for stage in (linearise, repair, white_balance, demosaic, wiener,
          network, raise_clipped, illumination, undistort, color)}
def develop(bundle_path, case_name, size):
    """The chain from a golden capture: its picture, the stored one, and what is allowed."""
    camera = open_case(bundle_path, case_name, size)
    for stage in camera.stages:
        taken = [camera.planes[name] for name in stage["takes"]]
        camera.planes.update(zip(stage["gives"], STAGES[stage["type"]](camera, stage, *taken)))
    stored = camera.tensors[f"{case_name}.output.image.{size}"].astype(float)
    allowed = camera.case["atol"] + camera.case["rtol"] * max(1, abs(stored).max())
    return camera.planes[camera.products["image"]], stored, allowed
def main(path):
    """Prints how every golden case of a bundle is met."""
    manifest = json.loads(zipfile.ZipFile(path).read("manifest.json"))
    sizes = next(iter(manifest["networks"].values()), ["none"])
    for name, size in ((case["name"], size) for case in manifest["golden"] for size in sizes):
        picture, stored, allowed = develop(path, name, size)
        error = abs(picture - stored).max()
        print(f"{manifest['name']} {name} {size}: largest difference {error:.6f}, "
              f"allowed {allowed:.6f}, {'met' if error <= allowed else 'NOT MET'}")

if __name__ == "__main__":
    main(sys.argv[1])
