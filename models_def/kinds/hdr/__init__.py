"""Snapshot HDR, for training: a plate before a lens, behind it a sensor with a mosaic.

recipe         a camera and how its networks are trained, from TOML
thesis_recipe  its tables [thesis] and [glare]
material       what its plate writes beside a light
scenes         lamps at night, and pictures with lamps put into them
samples        a scene photographed, its lights found from their streaks, and what they are
validation     fixed captures to choose by
thesis         the thesis's networks, to compare with: samples, losses, fitter, judging
training       all of it as training asks for it
"""

from camkit.models_def.kinds.hdr.training import FITTING, PART

__all__ = ["FITTING", "PART"]
