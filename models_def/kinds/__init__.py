"""Kinds of cameras at design time: one folder each.

A folder defines `PART` (`camkit.models_def.training.kind`) and where it has such

    FITTING        losses of its own (`camkit.models_def.training.fitting`)
    REFINING       later training (`camkit.models_def.training.refinement`)
    BANK_FITTING   a bank of colours to fit (`camkit.models_def.training.bank_fitting`)
    PREPARING      samples made before training (`camkit.models_def.training.preparing`)
"""
