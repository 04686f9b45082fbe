"""Single photons.

tables      tables 4.1 and 4.2: networks of every sampling trained and judged; `table`
baselines   those networks as the bundle that `camkit bench` reads; `edge_export`
linear      the runtime's linear estimate, as a row of the tables
"""
