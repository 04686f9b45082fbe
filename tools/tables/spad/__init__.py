"""Tables 4.1 and 4.2: how an array samples, and what makes a picture of it.

array_training  its networks, by the shipped recipe with another sampling
array_table     every row on the test sets, at every level of light
array_record    means, their spread over seeds, gains; the thesis's figures; the tables
baselines       the networks of other samplings as the bundle that `camkit bench` reads
edge_export     bicubic interpolation for graphs of bundles
"""
