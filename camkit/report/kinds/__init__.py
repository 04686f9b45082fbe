"""The kinds of cameras that come with camkit, as reports see them: one folder each.

bayer    colour photographs behind a mosaic
"""
