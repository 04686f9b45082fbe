"""Samples of a lens with a haze: cut from whole frames, since a patch holds none.

photographs    whole frames photographed, their haze taken away by the runtime
tiles          parts of frames on disk, behind the haze and before the bank
samples        tiles through the bank: samples to train on, captures to choose by
preparation    photographs and tiles as `camkit prepare` asks for them: PREPARING
"""
