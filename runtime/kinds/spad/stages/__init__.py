"""The stages of arrays that count single photons; `camkit.runtime.stage_finder` says what each has.

correct        pile-up undone; dark counts, hot and blind pixels known
super_resolve  photons on the fine grid of a plate
sharpen        times of photons to depth
lifetime       times of photons to the lifetime of what sent them
"""
