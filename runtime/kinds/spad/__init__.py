"""Captures of single photons: pulses, banks of them, fits and their bounds; products.

files          readers of captures
captures       captures on their way to products
pixels         what is known of pixels besides their counts
timing         what is known of their times
containers     what files hold, in bytes, before it is read
pulse          the time of one photon, in closed form
time_axis      bins of a histogram or delays of a gate: what each sees of a pulse
pile_up        counts as a detector that is never blind would have given them
guess_pulse    a pulse where none is stated
bank           templates at many times of flight, scored against counts
bound          the Cramer-Rao bound of a time of flight
template_cubics   templates between those of a bank
fit            time, amplitude, background and sigma of every pixel
least_squares  the same by least squares, as the dissertation does
two_returns    two surfaces in one pixel, fitted together
second_return  the second, where the residual of one asks for it
surroundings   whether a pixel lies inside the surface around it
scatter        scatter that the correction of pile-up leaves
evidence       from when on a return is believed
pooling        photons shared with neighbours where a pixel alone has too few
hot_pixels     pixels that count without light: found and painted over
sharpen        all of it for the rows of a capture
lifetime       decays of fluorescence behind a pulse
finer          the fine grid behind the plate of a bundle
stages         what its bundles list
twin           scenes recorded by the array of a bundle
golden_captures   those that its bundles hold
products       depth, intensity, light in flight, and their files
"""

from typing import Final

from camkit.bundle.stages import Correct, Lifetime, Sharpen
from camkit.runtime.kind import RuntimePart
from camkit.runtime.kinds.spad.captures.photon_capture import photons_of_array, read_photons
from camkit.runtime.kinds.spad.files.bundle_name import named_bundle
from camkit.runtime.kinds.spad.files.described import describe
from camkit.runtime.kinds.spad.golden_captures import GOLDEN
from camkit.runtime.kinds.spad.products import OUTPUTS, PLANES
from camkit.runtime.kinds.spad.products.decisions import know_photons
from camkit.runtime.kinds.spad.twin.photon_twin import record
from camkit.runtime.kinds.spad.twin.recording import PhotonOptions
from camkit.runtime.kinds.spad.twin.write import SUFFIXES, files_of, write_recorded

PART: Final = RuntimePart(
    read=read_photons,
    from_array=photons_of_array,
    stages=(Correct(), Sharpen(takes=("photons",)), Lifetime()),
    products=PLANES,
    know=know_photons,
    outputs=OUTPUTS,
    of_capture=frozenset(),
    bundle_of=named_bundle,
    describe=describe,
    simulate=record,
    simulation=PhotonOptions,
    write=write_recorded,
    suffixes=SUFFIXES,
    files=files_of,
    golden=GOLDEN,
    laws="camkit.runtime.kinds.spad.twin.laws",
)
