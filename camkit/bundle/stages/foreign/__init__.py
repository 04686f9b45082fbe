"""Stages and numbers of networks that somebody else trained (format 2.11).

pack, unpack   a mosaic as planes of half its size, and back
coding         the space of a network's planes, their range, a map of the noise
"""
