"""Tables 5.4 and 5.5: optics and networks beside each other, each read back from one capture.

plates        the plates that rows stand behind, and their bundles without a network
night_scenes  what is photographed, and into which group it falls
restoring     a capture to the picture of a row
night_table   the rows, how they are trained and measured
night_record  means over scenes and seeds, the scenes that end below their input, the tables
"""
