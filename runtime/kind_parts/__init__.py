"""Parts of a kind of camera for the ordinary commands, as data with defaults for photographs.

outputs           files that its captures become
picture_files     those of photographs
product_files     those of all else
photograph_facts  what a photograph states of itself
golden            golden captures of its bundles
"""
