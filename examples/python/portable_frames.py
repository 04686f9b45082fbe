"""A portable array of single photons in numpy and onnxruntime: counts in, pictures on the fine grid out."""
import json
from pathlib import Path
import numpy as np, onnxruntime as ort

class PortableArray:
    def __init__(self, folder, size="M", threads=1):
        facts, options = json.loads((Path(folder) / "portable.json").read_text()), ort.SessionOptions()
        self.scale, options.intra_op_num_threads = facts["sensor"]["sub_pixels"], threads
        names = "white", facts["networks"][size]["graph"]
        self.white, self.frame = (ort.InferenceSession(Path(folder) / facts["graphs"][name]["file"], options) for name in names)

    def develop(self, frames, dark=0.0):
        """Return photons (n, m h, m w) of counts (n, h, w); dark: counts of a pixel that are not light."""
        frames, dark = np.float32(frames) - np.float32(dark), np.float32(np.broadcast_to(dark, frames.shape[1:]))
        (white,) = self.white.run(None, {"frames": frames})
        return np.stack([self.frame.run(None, {"photons": f, "dark": dark, "white": white})[0] for f in frames])
