"""Tables 5.4 and 5.5: optics and networks beside each other, each read back from one capture.

rows       what is compared
cameras    the plates that rows stand behind, and their bundles without a network
training   the networks of rows, each for the same CPU time
scenes     what is photographed, and into which group it falls
restoring  a capture to the picture of a row
measuring  every row on every scene; what is finished is in a journal
record     means over scenes and seeds, and the scenes that end below their input
text       the record as tables
"""
