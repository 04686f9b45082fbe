"""Captures of single photons: pulses, banks of them, fits and their bounds; products.

files          readers of captures
timing         what is known of their times
containers     what files hold, in bytes, before it is read
pulse          the time of one photon, in closed form
time_axis      bins of a histogram or delays of a gate: what each sees of a pulse
corrected      rows of a capture, pile-up undone
pile_up        counts as a detector that is never blind would have given them
guess_pulse    a pulse where none is stated
bank           templates at many times of flight, scored against counts
bound          the Cramer-Rao bound of a time of flight
fit            time, amplitude, background and sigma of every pixel
least_squares  the same by least squares, as the dissertation does
two_returns    two surfaces in one pixel, fitted together
evidence       from when on a return is believed
pooling        photons shared with neighbours where a pixel alone has too few
hot_pixels     pixels that count without light: found and painted over
sharpen        all of it for the rows of a capture
lifetime       decays of fluorescence behind a pulse
finer          the fine grid behind the plate of a bundle
twin           scenes recorded by the array of a bundle
proving        its golden cases
products       depth, intensity, light in flight, and their files
"""

from typing import Final

from camkit.runtime.kind import RuntimePart
from camkit.runtime.kind_parts.recording import Recording
from camkit.runtime.kinds.spad.products.maker import MAKER
from camkit.runtime.kinds.spad.proving import PROVING
from camkit.runtime.kinds.spad.twin.simulate import record
from camkit.runtime.kinds.spad.twin.write import SUFFIXES, files_of, write_recorded

PART: Final = RuntimePart(
    maker=MAKER,
    proving=PROVING,
    laws="camkit.runtime.kinds.spad.twin.laws",
    recording=Recording(suffixes=SUFFIXES, record=record, write=write_recorded, files=files_of),
)
