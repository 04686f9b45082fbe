"""What a kind of camera brings to the ordinary commands, as data with defaults for photographs.

outputs  files that its captures become
golden   golden captures of its bundles
"""
