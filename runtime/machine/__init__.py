"""The machine: what a bundle may ask of it, its memory, its threads.

limits     what a bundle may ask at most, and how who wants more says so
memory     peak of this process, freed memory given back, arrays that lie in files
processor  what the system says of it, and whether it multiplies bfloat16
slices     rows shared among threads, with the same bits
"""
