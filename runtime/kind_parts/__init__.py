"""Parts of a kind whose captures are no photographs, beside its maker.

proving    golden captures of its bundles, and what becomes of them again
recording  scenes recorded by its cameras, and their files
"""
