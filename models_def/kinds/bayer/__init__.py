"""A camera for photographs, behind a mosaic or of planes: its lens, its Wiener bank in front.

scene_light            a display that shows scenes; daylight and lights beyond white
recipe                 what a person edits beside the common tables
psf_bank, lens_bank    kernels of the frozen PSF and of fabricated copies
measured_bank          the same of a measured PSF, and copies within its uncertainty
material               both, as samples need them; DESIGNED: the optics of a recipe
samples                scenes photographed, filtered and stabilised
frames/                the same of a lens with a haze, cut from whole frames: PREPARING
validation             what a run is chosen by
training               all of it as the trainer asks for it: PART
bank_fit               the numbers of a bank that restores colours together: BANK_FITTING
fine_tuning/           afterwards: discriminators, features, real pairs: REFINING
fitting                by what a picture looks like, and against a critic: FITTING
"""

from camkit.models_def.kinds.bayer.bank_fit import BANK_FITTING
from camkit.models_def.kinds.bayer.fine_tuning.bayer_refinement import REFINING
from camkit.models_def.kinds.bayer.fitting import FITTING
from camkit.models_def.kinds.bayer.frames.preparation import PREPARING
from camkit.models_def.kinds.bayer.material import DESIGNED
from camkit.models_def.kinds.bayer.training import PART

__all__ = ["BANK_FITTING", "DESIGNED", "FITTING", "PART", "PREPARING", "REFINING"]
