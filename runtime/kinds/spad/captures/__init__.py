"""Captures of single photons on their way to products.

settings        what the caller chose, with the timing file
bundle_times    times and pulse of a bundle, where a capture states none
photon_capture  an open capture with all that is known of its times
corrected       rows of a capture, pile-up undone
strips          in how many rows at once a capture is worked through
frames          photons by pixel and time, without dark counts and hot pixels
known_pulse     the pulse of a capture
"""
