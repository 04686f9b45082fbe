"""Samples that a decoder put at another place after their stream broke.

row_order   rows that go on shifted, skewed or scrambled
tile_edges  tiles that break off
"""
