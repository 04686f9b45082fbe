"""A portable camera in numpy and onnxruntime: the mosaic of a capture in, linear Rec.709 out."""

import json
import math
from pathlib import Path

import numpy as np
import onnxruntime as ort


class PortableCamera:
    def __init__(self, folder, size="M", threads=1):
        self.facts, options = json.loads((Path(folder) / "portable.json").read_text()), ort.SessionOptions()
        options.intra_op_num_threads, data = threads, (Path(folder) / self.facts["tables"]).read_bytes()
        start = 8 + int.from_bytes(data[:8], "little")  # safetensors: length, JSON, numbers
        cut = lambda entry: data[start:][slice(*entry["data_offsets"])]
        self.tables = {name: np.frombuffer(cut(entry), np.float32).reshape(entry["shape"])
                       for name, entry in json.loads(data[8:start]).items() if name != "__metadata__"}
        self.network = self.facts["networks"][size]
        other = {network["graph"] for network in self.facts["networks"].values()} - {self.network["graph"]}
        self.graphs = {name: (graph, ort.InferenceSession(Path(folder) / graph["file"], options))
                       for name, graph in self.facts["graphs"].items() if name not in other}

    def run(self, name, values):
        graph, session = self.graphs[name]
        given = {i: values[i] for i in graph["inputs"]} | {t: self.tables[t] for t in graph["tables"]}
        return dict(zip(graph["outputs"], session.run(graph["outputs"], given)))

    def develop(self, mosaic, iso, white_balance, origin_px=(0, 0), levels=None, straight=True):
        """Return (3, h, w); mosaic (h, w) in DN, white_balance gains, origin_px (x, y) on the sensor."""
        sensor = self.facts["sensor"]
        black, white = levels or (sensor["black_level"], sensor["white_level"])
        clip, axis = math.ceil(black + sensor["clip_share"] * (white - black)), np.subtract(sensor["axis_px"], origin_px)
        shot, read = noise_at(sensor, iso)
        self.known = {"levels": np.float32([black, white, clip]), "gains": np.float32(white_balance),
                      "shot": np.full(3, shot, np.float32), "read_variance": np.full(3, read, np.float32)}
        even = self.clean(self.restore(mosaic, mosaic >= clip, axis), mosaic >= clip, axis)
        return self.straighten(even, axis) if straight else even

    def restore(self, mosaic, clipped, axis):
        """Return demosaicked and restored planes, (6, h, w), from blocks that are windowed and added."""
        bank, (h, w), places = self.facts["bank"], mosaic.shape, {}
        block, margin, red = bank["block_px"], bank["margin_px"], divmod(self.facts["sensor"]["cfa"].index("R"), 2)
        for rows in spans(bank, h, axis[1], red[0], self.facts["sensor"]["pitch_mm"]):
            for columns in spans(bank, w, axis[0], red[1], self.facts["sensor"]["pitch_mm"]):
                places.setdefault((columns["place"], rows["place"]), []).append((rows, columns))
        total = np.zeros((6, h, w), np.float32)
        for place, blocks in places.items():
            kind = "_mosaic" if bank["mosaic_within_mm"] is not None and math.hypot(*place) <= bank["mosaic_within_mm"] else ""
            known = self.known | self.run("place" + kind, {"place_mm": np.float32(place)})
            for rows, columns in blocks:
                known["mosaic"] = mosaic[rows["index"][:, None], columns["index"]].astype(np.float32)
                known["phase"] = np.array([2 * rows["phase"] + columns["phase"]])
                known["window_y"], known["window_x"] = rows["window"], columns["window"]
                inner = rows["index"][margin:-margin, None], columns["index"][margin:-margin]
                lit = bank["lights"] and clipped[inner].any()
                out = self.run("block" + kind + "_lights" * bool(lit), known)["out"][:, :: rows["step"], :: columns["step"]]
                total[:, rows["to"], columns["to"]] += out[:, rows["of"], columns["of"]]
        return total

    def clean(self, planes, clipped, axis):
        """Return (3, h, w), clean and even light of the camera's colours, from tiles with a halo."""
        kept = self.run("kept", {"clipped": np.float32(clipped)[None, None]})["out"][0]
        (_, h, w), stride, halo, side = planes.shape, self.network["stride_px"], self.network["halo_px"], self.facts["tile_px"]
        planes, kept = (np.pad(part, ((0, 0), (0, -h % stride), (0, -w % stride)), mode="edge") for part in (planes, kept))
        even = np.empty((3, *planes.shape[1:]), np.float32)
        for y, height, top, bottom in tiles(even.shape[1], side, halo, stride):
            for x, width, left, right in tiles(even.shape[2], side, halo, stride):
                part, origin = np.s_[None, :, y : y + height, x : x + width], (np.array([x, y]) - axis) * self.facts["sensor"]["pitch_mm"]
                out = self.run(self.network["graph"], self.known | {"planes": planes[part], "kept": kept[part], "origin_mm": np.float32(origin)})["out"]
                even[:, top:bottom, left:right] = out[0, :, top - y : bottom - y, left - x : right - x]
        return even[:, :h, :w]

    def straighten(self, even, axis):
        """Return (3, h, w), linear Rec.709 without distortion, from boxes around where tiles come from."""
        size, side, straight = np.array(even.shape[:0:-1]), self.facts["warp_px"], np.empty_like(even)
        for x, y in np.ndindex(*-(-size // side)):
            target = np.array([x, y]) * side
            known = self.run("places", {"target_px": target.astype(float), "axis_px": axis.astype(float), "middle_px": (size - 1) / 2})
            first = np.clip(np.floor(known["least"]).astype(int) - 1 + target, 0, size - 1)
            last = np.clip(np.ceil(known["most"]).astype(int) + 3 + target, first + 1, size)
            known |= {"planes": even[None, :, first[1] : last[1], first[0] : last[0]], "first_px": np.float32(first - target)}
            made = self.run("warp", known) if known["planes"].max() <= self.facts["warp_white"] else {"least": -math.inf}
            made = made if made["least"] >= self.facts["warp_floor"] else self.run("warp_limited", known)
            part = straight[:, target[1] : target[1] + side, target[0] : target[0] + side]
            part[...] = made["out"][:, : part.shape[1], : part.shape[2]]
        return straight


def spans(bank, size, axis, red, pitch):
    """Yield the blocks along an axis; one on the far side of the optical axis is mirrored."""
    block, overlap, step = bank["block_px"], bank["overlap_px"], bank["block_px"] - bank["overlap_px"]
    count, period = max(1, math.ceil((size + 2 * bank["border_px"] - overlap) / step)), max(2 * size - 2, 1)
    rise = np.sin(np.pi / 2 * np.clip((np.arange(overlap) + 0.5 - overlap / 4) / (overlap / 2), 0, 1)) ** 2
    for i in range(count):
        first, window = i * step - (count * step + overlap - size) // 2, np.ones(block)
        window[:overlap] *= rise if i > 0 else 1
        window[step:] *= rise[::-1] if i < count - 1 else 1
        start, stop = max(first, 0), min(first + block, size)
        live = np.flatnonzero(window[start - first : stop - first]) + start
        start, stop = live[0], live[-1] + 1
        place = ((start + stop - 1) / 2 - axis) * pitch
        turn = -1 if bank["mirrors"] and place < 0 else 1
        at = np.arange(first - bank["margin_px"], first + block + bank["margin_px"])[::turn] % period
        yield {"place": round(turn * place, 9), "step": turn, "index": np.minimum(at, period - at), "phase": (red - first - (turn < 0)) % 2,
               "window": np.float32(window[::turn]), "to": slice(start, stop), "of": slice(start - first, stop - first)}


def tiles(size, side, halo, stride):
    """Yield of every tile along an axis its first pixel, its side, and the pixels that are kept."""
    count = max(1, math.ceil((size - 2 * halo) / (side - 2 * halo)))
    side = -(-(size + (count - 1) * 2 * halo) // (count * stride)) * stride
    firsts = [min(i * (side - 2 * halo), size - side) for i in range(count)]
    cuts = [0, *(first + halo for first in firsts[1:]), size]
    yield from zip(firsts, [side] * count, cuts, cuts[1:])


def noise_at(sensor, iso):
    """Return variance per light, and at black; beyond the table the gain goes on as 1 / ISO."""
    isos, gains, reads = np.array([[e["iso"], e["gain_e_per_dn"], e["read_noise_e"]] for e in sensor["noise"]]).T
    at, isos = math.log(iso), np.log(isos)
    gain = math.exp(np.interp(at, isos, np.log(gains)) - max(at - isos[-1], 0))
    shot = 1 / (gain * (sensor["white_level"] - sensor["black_level"]))
    return shot, (np.interp(at, isos, reads) * shot) ** 2
