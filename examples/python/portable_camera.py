"""A portable camera in numpy and onnxruntime: the mosaic of a capture in, linear Rec.709 out."""

import json
import math
from pathlib import Path

import numpy as np
import onnxruntime as ort


def read_safetensors(path):
    data = Path(path).read_bytes()
    start = 8 + int.from_bytes(data[:8], "little")
    table = {k: v for k, v in json.loads(data[8:start]).items() if k != "__metadata__"}
    views = {k: data[start + v["data_offsets"][0] : start + v["data_offsets"][1]] for k, v in table.items()}
    return {k: np.frombuffer(views[k], np.float32).reshape(v["shape"]) for k, v in table.items()}


def spans(size, block, overlap, border):
    """Yield of every block along an axis: its first sample, and its window, 0 outside the picture."""
    step = block - overlap
    count = max(1, math.ceil((size + 2 * border - overlap) / step))
    t = (np.arange(overlap) + 0.5 - overlap / 4) / (overlap / 2)
    rise = np.sin(np.pi / 2 * np.clip(t, 0, 1)) ** 2
    for i in range(count):
        window, first = np.ones(block), -((count * step + overlap - size) // 2) + i * step
        window[:overlap] *= rise if i > 0 else 1
        window[block - overlap :] *= rise[::-1] if i < count - 1 else 1
        at = np.arange(first, first + block)
        yield first, np.where((at >= 0) & (at < size), window, 0).astype(np.float32)


def windows(size, side, halo):
    """Yield of every tile along an axis: its first pixel, and those that are kept."""
    count = 1 if side >= size else math.ceil((size - 2 * halo) / (side - 2 * halo))
    firsts = [min(i * (side - 2 * halo), size - min(side, size)) for i in range(count)]
    cuts = [0, *(first + halo for first in firsts[1:]), size]
    yield from zip(firsts, cuts, cuts[1:])


class PortableCamera:
    def __init__(self, folder, size="M", threads=1):
        self.about = json.loads((Path(folder) / "portable.json").read_text())
        self.network, options = self.about["networks"][size], ort.SessionOptions()
        options.intra_op_num_threads, tables = threads, read_safetensors(Path(folder) / self.about["tables"])
        other = {n["graph"] for s, n in self.about["networks"].items() if s != size}
        self.graphs = {name: (ort.InferenceSession(Path(folder) / g["file"], options), g["inputs"], {t: tables[t] for t in g["tables"]}, g["outputs"])
                       for name, g in self.about["graphs"].items() if name not in other}

    def run(self, name, values):
        session, inputs, tables, outputs = self.graphs[name]
        return dict(zip(outputs, session.run(outputs, tables | {i: values[i] for i in inputs})))

    def develop(self, mosaic, iso, white_balance, origin_px=(0, 0), levels=None, warp=True):
        sensor, bank, (h, w) = self.about["sensor"], self.about["bank"], mosaic.shape
        black, white = levels or (sensor["black_level"], sensor["white_level"])
        clip, axis = math.ceil(black + sensor["clip_share"] * (white - black)), np.array(sensor["axis_px"]) - origin_px
        shot, read = noise_at(sensor, iso)
        self.known = {"levels": np.float32([black, white, clip]), "gains": np.float32(white_balance), "shot": np.full(3, shot, np.float32), "read_variance": np.full(3, read, np.float32)}
        planes = self.restore(mosaic, clip, axis)
        even = self.clean(planes, (mosaic >= clip).astype(np.float32), axis)
        return self.straighten(even, axis) if warp else even
    def restore(self, mosaic, clip, axis):
        """Return demosaicked and restored planes, (6, h, w): blocks by place, mirrored places one."""
        sensor, bank, (h, w) = self.about["sensor"], self.about["bank"], mosaic.shape
        red, margin, block = divmod(sensor["cfa"].index("R"), 2), bank["margin_px"], bank["block_px"]
        grid, places = (block, bank["overlap_px"], bank["border_px"]), {}
        for y, wy in spans(h, *grid):
            for x, wx in spans(w, *grid):
                middle = [first + np.flatnonzero(window)[[0, -1]].mean() for first, window in ((x, wx), (y, wy))]
                place = (np.array(middle) - axis) * sensor["pitch_mm"]
                flips = place < 0 if bank["mirrors"] else np.zeros(2, bool)
                key = tuple(np.round(np.where(flips, -place, place), 9))
                places.setdefault(key, []).append(((y, wy, flips[1], h, red[0]), (x, wx, flips[0], w, red[1])))
        total = np.zeros((6, h, w), np.float32)
        for place, blocks in places.items():
            within = bank["mosaic_within_mm"]
            kind = "_mosaic" if within is not None and math.hypot(*place) <= within else ""
            known = self.known | self.run("place" + kind, {"place_mm": np.float32(place)})
            for axes in blocks:
                rows, columns = ([fold(first, block, margin, size, flip) for first, _, flip, size, _ in axes])
                known["window_y"], known["window_x"] = (window[::-1] if flip else window for _, window, flip, _, _ in axes)
                known["mosaic"] = mosaic[np.ix_(rows, columns)].astype(np.float32)
                phase = [(place - first - flip) % 2 for first, _, flip, _, place in axes]
                known["phase"] = np.array([2 * phase[0] + phase[1]])
                lit = bank["lights"] and known["mosaic"][margin:-margin, margin:-margin].max() >= clip
                out = self.run("block" + kind + ("_lights" if lit else ""), known)["out"]
                (y, _, down, _, _), (x, _, across, _, _) = axes
                out = out[:, :: -1 if down else 1, :: -1 if across else 1]
                t, l, b, r = max(y, 0), max(x, 0), min(y + block, h), min(x + block, w)
                total[:, t:b, l:r] += out[:, t - y : b - y, l - x : r - x]
        return total

    def clean(self, planes, clipped, axis):
        """Return (3, h, w): light of the camera's colours, clean and even."""
        (_, h, w), stride, halo = planes.shape, self.network["stride_px"], self.network["halo_px"]
        pad, pitch = ((0, -h % stride), (0, -w % stride)), self.about["sensor"]["pitch_mm"]
        planes, clipped = (np.pad(p, ((0, 0), *pad), mode="edge") for p in (planes, clipped[None]))
        even, (height, width) = np.empty((3, *planes.shape[1:]), np.float32), planes.shape[1:]
        side = self.about["tile_px"]
        for y, top, bottom in windows(height, side, halo):
            for x, left, right in windows(width, side, halo):
                part = np.s_[None, :, y : y + side, x : x + side]
                origin = np.float32((np.array([x, y]) - axis) * pitch)
                out = self.run(self.network["graph"], self.known | {"planes": planes[part], "clipped": clipped[part], "origin_mm": origin})["out"]
                even[:, top:bottom, left:right] = out[0, :, top - y : bottom - y, left - x : right - x]
        return even[:, :h, :w]

    def straighten(self, even, axis):
        """Return (3, h, w): linear Rec.709 without distortion."""
        (_, h, w), side = even.shape, self.about["warp_px"]
        picture = np.empty_like(even)
        for y in range(0, h, side):
            for x in range(0, w, side):
                known = {"target_px": np.array([x, y], float), "axis_px": axis.astype(float), "middle_px": np.array([(w - 1) / 2, (h - 1) / 2])}
                places = self.run("places", known)["places"]
                b, r = min(y + side, h), min(x + side, w)
                used = places[:, : b - y, : r - x]
                first = np.clip(np.floor(used.min((0, 1, 2))).astype(int) - 1 + [x, y], 0, [w - 1, h - 1])
                last = np.clip(np.floor(used.max((0, 1, 2))).astype(int) + 3 + [x, y], 1, [w, h])
                box = np.ascontiguousarray(even[None, :, first[1] : max(last[1], first[1] + 1), first[0] : max(last[0], first[0] + 1)])
                out = self.run("warp", {"planes": box, "places": places, "first_px": np.float32(first - [x, y])})["out"]
                picture[:, y:b, x:r] = out[:, : b - y, : r - x]
        return picture


def fold(first, block, margin, size, flip):
    """Return the rows of a block with its margin, mirrored about the outermost ones of the picture."""
    at = np.arange(first - margin, first + block + margin) % max(2 * (size - 1), 1)
    at = np.minimum(at, max(2 * (size - 1), 1) - at) if size > 1 else 0 * at
    return at[::-1] if flip else at


def noise_at(sensor, iso):
    """Return variance per light and at black; beyond the table gain goes on as 1 / ISO."""
    table = sensor["noise"]
    isos = np.log([entry["iso"] for entry in table])
    inside = min(max(math.log(iso), isos[0]), isos[-1])
    gain = math.exp(np.interp(inside, isos, np.log([e["gain_e_per_dn"] for e in table])) - max(math.log(iso) - isos[-1], 0))
    shot = 1 / (gain * (sensor["white_level"] - sensor["black_level"]))
    return shot, (np.interp(inside, isos, [e["read_noise_e"] for e in table]) * shot) ** 2
