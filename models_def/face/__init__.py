"""Design time for programs and the command line; nothing here imports torch before it is needed.

torch_need        the check that torch is there
optics_freezing   `camkit.freeze`: optics to a frozen PSF
network_training  `camkit.train`: a recipe to a checkpoint
"""
