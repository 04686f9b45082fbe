"""Containers of arrays: what they hold, in bytes, before it is read.

packed        members of a zip as bytes that can be sliced, unpacked under a cap
npy_header    headers of .npy
stored_array  small arrays that a timing file names
hdf5_tree     groups and data sets of HDF5, walked within bounds
mat_sizes     what a variable of a MATLAB file takes
"""
