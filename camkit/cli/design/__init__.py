"""Commands of design time; they need torch.

    lens      one lens file: look at it, improve it, convert it
    plate     one plate: look at it, design it, etch it
    design    a lens and its network designed together
    freeze    a lens to a frozen PSF
    fit_bank  the bank that restores colours together
    prepare   whole frames of a camera with a haze, for train and fit-bank
    freeze_norms  norms of a trained network become constants
    train     a recipe to a checkpoint
    export    checkpoints and PSF to one proved bundle

`design_time` is what they share: asking for torch, keeping files, printing a report.
"""
