"""One module per rule: ORDER and `decide(subject, work) -> (work, decision or None)`.

scale          whether the mosaic is averaged over squares first
size           which network
cells          which lattice cells get it, a smaller one, the bank alone, or nothing
lights         where a network runs that acts near lights alone
blocks         which blocks of the bank are filtered
wavelengths    how many wavelengths the bank uses
halo           how far windows look beyond their cells
undistortion   whether the picture is warped
"""
