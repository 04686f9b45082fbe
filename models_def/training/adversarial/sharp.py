"""Sharp pictures that nobody captured: what a critic may know of pictures beside the truth."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from camkit.colorimetry import decode_srgb, encode_srgb
from camkit.models_def.training.pictures import open_source

LEAST_LIGHT = 1e-6


class SharpCrops:
    """Crops of a folder of pictures, decoded once each."""

    def __init__(self, folder: Path) -> None:
        """Open a folder.

        Raises:
            ContractError: If it is not there or holds no picture.
        """
        self._source = open_source(folder, picture_share=1.0, scenes=1, scene_px=1)

    def put_among(self, rng: np.random.Generator, real: Tensor, share: float) -> Tensor:
        """Replace some true pictures by crops.

        A crop is as bright as the picture that it replaces, so that exposure tells nothing.

        Args:
            rng: Decides which, and what.
            real: (b, 3, h, h) sRGB in 0..1.
            share: Of the true pictures that are replaced, on average.

        Returns:
            The same shape.
        """
        mixed = real.clone()
        for i in np.flatnonzero(rng.random(len(real)) < share):
            light = float(decode_srgb(real[i].cpu().numpy()).mean())
            crop = self._source.draw_crop(rng, real.shape[-1])
            exposed = crop * np.float32(light / max(float(crop.mean()), LEAST_LIGHT))
            mixed[i] = torch.from_numpy(encode_srgb(exposed)).to(real)
        return mixed
