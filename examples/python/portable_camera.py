"""A portable camera in numpy and onnxruntime: the mosaic of a capture in, linear Rec.709 out."""
import json, math
from pathlib import Path
import numpy as np, onnxruntime as ort

class PortableCamera:
    def __init__(self, folder, size="M", threads=1):
        self.facts = json.loads((Path(folder) / "portable.json").read_text())
        self.network, self.sensor, self.bank = self.facts["networks"][size], self.facts["sensor"], self.facts["bank"]
        data, options = (Path(folder) / self.facts["tables"]).read_bytes(), ort.SessionOptions()
        start, options.intra_op_num_threads = 8 + int.from_bytes(data[:8], "little"), threads
        self.tables = {name: np.frombuffer(data[start:][slice(*t["data_offsets"])], np.float32).reshape(t["shape"])
                       for name, t in json.loads(data[8:start]).items() if name != "__metadata__"}
        self.graphs = {name: (graph, ort.InferenceSession(Path(folder) / graph["file"], options))
                       for name, graph in self.facts["graphs"].items() if name in (self.network["graph"], *self.facts["common"])}

    def run(self, name, values):
        graph, session = self.graphs[name]
        inputs = {i: values[i] for i in graph["inputs"]} | {t: self.tables[t] for t in graph["tables"]}
        return dict(zip(graph["outputs"], session.run(graph["outputs"], inputs)))

    def develop(self, mosaic, iso, white_balance, origin_px=(0, 0), levels=None, straight=True):
        """Return (3, h, w) of a mosaic (h, w) in DN; origin_px is (x, y) of its first pixel on the sensor."""
        black, white = levels or (self.sensor["black_level"], self.sensor["white_level"])
        clip = math.ceil(black + self.sensor["clip_share"] * (white - black))
        axis = np.subtract(self.sensor["axis_px"], origin_px).astype(float)
        self.capture = self.run("noise", {"iso": np.array([iso], float)})
        self.capture |= {"levels": np.float32([black, white, clip]), "gains": np.float32(white_balance)}
        even = self.clean(self.restore(mosaic, mosaic >= clip, axis), mosaic >= clip, axis)
        return self.straighten(even, axis) if straight else even

    def restore(self, mosaic, clipped, axis):
        """Return demosaicked and restored planes, (6, h, w): blocks, windowed and added, place by place."""
        side, m, within = (self.bank[name] for name in ("block_px", "margin_px", "mosaic_within_mm"))
        planes, places = np.zeros((6, *np.add(mosaic.shape, 2 * side)), np.float32), {}
        red = np.add(self.sensor["red_px"], axis - self.sensor["axis_px"]).astype(int) % 2
        down, across = (self.run("spans", {"size_px": np.array([n]), "axis_px": np.array([at]), "red": np.array([r])})
                        for n, at, r in zip(mosaic.shape, axis[::-1], red[::-1]))
        if self.facts.get("haze"):  # it is found in coarse cells of the whole capture
            self.capture |= self.run("haze", {"axis_px": axis} | self.run("cells", {"mosaic": np.float32(mosaic), "red_px": red} | self.capture))
        for i, j in np.ndindex(len(down["turn"]), len(across["turn"])):
            places.setdefault((across["place_mm"][j], down["place_mm"][i]), []).append((i, j))
        for place, blocks in places.items():
            kind = "_mosaic" if within is not None and math.hypot(*place) <= within else ""
            values = self.capture | self.run("place" + kind, {"place_mm": np.float32(place)})
            for i, j in blocks:
                y, x = down["index"][i, :, None], across["index"][j]
                values |= {"window_y": down["window"][i], "window_x": across["window"][j], "row_index": y[:, 0], "column_index": x}
                values |= {"mosaic": np.float32(mosaic[y, x]), "phase": 2 * down["phase"][i : i + 1] + across["phase"][j]}
                lights = "_lights" if self.bank["lights"] and clipped[y[m:-m], x[m:-m]].any() else ""
                out = self.run("block" + kind + lights, values)["out"][:, :: down["turn"][i], :: across["turn"][j]]
                top, left = down["first_px"][i] + side, across["first_px"][j] + side
                planes[:, top : top + side, left : left + side] += out
        return planes[:, side:-side, side:-side]

    def clean(self, planes, clipped, axis):
        """Return (3, h, w), clean and even light of the camera's colours: tiles, of which the halo is left out."""
        stride, halo, (h, w) = self.network["stride_px"], self.network["halo_px"], clipped.shape
        kept = self.run("kept", {"clipped": np.float32(clipped)[None, None]})["out"][0]
        margins = (0, 0), (0, -h % stride), (0, -w % stride)
        planes, kept = ((np.pad(p, margins, mode="edge") if np.any(margins) else p)[None] for p in (planes, kept))
        even = np.empty((3, *planes.shape[2:]), np.float32)
        for y, bottom, top, end in self.tiles(planes.shape[2], stride, halo):
            for x, right, left, last in self.tiles(planes.shape[3], stride, halo):
                values = {"planes": planes[:, :, y:bottom, x:right], "kept": kept[:, :, y:bottom, x:right]}
                values["origin_mm"] = np.float32((np.array([x, y]) - axis) * self.sensor["pitch_mm"])
                out = self.run(self.network["graph"], self.capture | values)["out"]
                even[:, top:end, left:last] = out[0, :, top - y : end - y, left - x : last - x]
        return even[:, :h, :w]

    def tiles(self, size, stride, halo):
        """Return of every tile along an axis its first and last pixel, and those between which it counts."""
        count = max(1, math.ceil((size - 2 * halo) / (self.network["tile_px"] - 2 * halo)))
        side = math.ceil((size + (count - 1) * 2 * halo) / (count * stride)) * stride
        firsts = np.minimum(np.arange(count) * (side - 2 * halo), size - side)
        cuts = [0, *(firsts[1:] + halo), size]
        return list(zip(firsts, firsts + side, cuts, cuts[1:]))

    def straighten(self, even, axis):
        """Return (3, h, w), linear Rec.709 without distortion: tiles of pixels from boxes around their places."""
        size, side, straight = np.array(even.shape[:0:-1]), self.facts["warp_px"], np.empty_like(even)
        for x, y in np.ndindex(*-(-size // side)):
            target = np.array([x, y]) * side
            values = self.run("places", {"target_px": target * 1.0, "axis_px": axis, "middle_px": (size - 1) / 2})
            first = np.clip(np.floor(values["least"]).astype(int) - 1 + target, 0, size - 1)
            last = np.clip(np.ceil(values["most"]).astype(int) + 3 + target, first + 1, size)
            values |= {"planes": even[None, :, first[1] : last[1], first[0] : last[0]], "first_px": np.float32(first - target)}
            out = self.run("warp" if values["planes"].max() <= self.facts["warp_white"] else "warp_limited", values)
            if out.get("least", 0) < self.facts["warp_floor"]:
                out = self.run("warp_limited", values)
            part = straight[:, target[1] : target[1] + side, target[0] : target[0] + side]
            part[...] = out["out"][:, : part.shape[1], : part.shape[2]]
        return straight
