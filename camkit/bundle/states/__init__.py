"""The states of a zoom or focusing lens in one file: each a frozen PSF with a name.

lens_state      one state, and the choice of one by name
state_tensors   their safetensors
"""
