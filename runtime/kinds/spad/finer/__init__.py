"""Photons on a grid finer than the array's, behind a plate that is known.

covariance   what is taken for granted of pictures
linear       the best linear estimate at a level of light, with what it makes of noise
sampling     what a pixel sees through: the plate, nothing, all of itself, a diffuser
camera       a bundle's array: its linear estimates, its networks
bins         bins made finer, and what a fit must know of them
sigma        sigma of times on the fine grid
depth        such bins, fitted
pictures     frames and light in flight made finer
"""
