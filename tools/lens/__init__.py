"""Lens profiles of others, held against what is made of them.

entries    every distortion of a lensfun database, converted
"""
