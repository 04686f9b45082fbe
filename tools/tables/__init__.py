"""Tables of the thesis made again: `python -m tools.tables TABLE train`, then `measure`.

    spad     4.1 and 4.2: how an array of single photons samples, and what makes a picture of it
    hdr      5.4 and 5.5: which optics, read by which network, bring clipped lights back
    losses   3.1: what a loss is worth where it was trained, and elsewhere
    lenses   6.1: which lens gives the best picture after recovery (it trains as it measures)

A table is rows, which are data, and how one of them is trained, measured and written. What trains
for equal times, keeps a journal and writes a record is one runner:

    table_rows       what is compared, and for how many seeds
    equal_training   the networks of rows, each for the same CPU time
    journal          finished work, by the hash of all that decides it
    recipe_text      recipes as text, a key with another value
    records          compact JSON and Markdown
    runner           the command line
"""
