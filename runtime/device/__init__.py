"""A device proves that it computes a bundle as the bundle says, before its first picture.

case_results   golden cases computed again, and how far each result is from the stored one
tile_windows   pictures in windows and whole, on which a network must agree
device_proof   the proof of one provider on this machine, made once a process
"""
