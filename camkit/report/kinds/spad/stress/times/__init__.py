"""Times of photons that are few, late, or not as stated; each module defines `SCENARIO`.

depth_photons, depth_sbr, depth_hot   few photons, much background, hot pixels
gate_width, gate_rc, orientation      a gate that is not what the bundle says
two_returns                           a second surface
pile_up, pile_up_free                 a detector that is blind after a photon
"""
