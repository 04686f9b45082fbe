"""Readers of captures of single photons: each gives rows of counts, whatever the file holds.

counts_file  what every reader gives
array_file   arrays in any order of axes, read by strips
stamps       time stamps sorted into bins
chosen       which of several variables is meant
npz          NPZ: stored members mapped, packed ones unpacked once
hdf5         HDF5, and MATLAB 7.3 by it
mat          MATLAB 5
tiff         stacks of pages
ptu          PicoQuant, by ptufile
sdt          Becker & Hickl histograms, by sdtfile
spc          Becker & Hickl photon streams
packed       members of a zip, unpacked under a cap
open_counts  the reader of a file, by its type
named        the bundle that a file names
described    what a file holds and states, for people
"""
