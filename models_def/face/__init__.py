"""Design time for programs and the command line; nothing here imports torch before it is needed.

torch_need        the check that torch is there
recipe_writing    `camkit.recipe`: a lens and a sensor to a recipe
lens_checks       whether a lens reaches the corner of a sensor, and what its rims take
state_freezing    several configurations of a lens to one frozen file
optics_freezing   `camkit.freeze`: optics to a frozen PSF
network_training  `camkit.train`: a recipe to a checkpoint
"""
