"""Single-photon arrays, for training: 64x32 small pixels that see 256x128 through a plate.

recipe      a camera and how its networks are trained, from TOML
sampling    how the array samples: a kernel, and one sub-pixel of every pixel
counting    photons counted, and what a network is told of their noise
plate_psf   the kernel of a plate: trained, written, read
networks    networks by name, alone or trained with the plate before them
samples     a picture seen by the array, counted, and the picture itself
theory      what the best linear estimate could know: the best Gaussian of a level of light
evaluation  the protocol of tables 4.1 and 4.2
validation  fixed photographs to choose by
fitter      one step of a network and its plate
training    all of it as training asks for it
"""

from camkit.models_def.kinds.spad.training import FITTING, PART

__all__ = ["FITTING", "PART"]
