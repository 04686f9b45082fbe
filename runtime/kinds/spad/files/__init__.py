"""Readers of captures of single photons: each gives rows of counts, whatever the file holds.

counts_file  what every reader gives
axes         which axis is which, and what is taken of further ones
channels     one of several channels, slices or frames
array_file   arrays in any order of axes, read by strips
stamps       time stamps sorted into bins
variable     which of several variables is meant
npz          NPZ: stored members mapped, packed ones unpacked once
hdf5         HDF5, and MATLAB 7.3 by it; broken: errors of its library
hdf5_counts  the data set that is meant
mat          MATLAB 5
tiff         stacks of pages
tiff_pages   their axes by name, and what they unpack to
ptu          PicoQuant, by ptufile
sdt          Becker & Hickl histograms, by sdtfile
spc          Becker & Hickl photon streams
open_counts  the reader of a file, by its type
bundle_name  the bundle that a file names
described    what a file holds and states, for people
"""
