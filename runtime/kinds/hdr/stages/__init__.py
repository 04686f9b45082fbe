"""The stages of snapshot HDR: one file each.

highlights   clipped lights read from their streaks, put into the picture
deglare      streaks of a wiped windshield taken out
"""
