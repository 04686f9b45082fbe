"""What design time knows of each kind of camera: one folder each.

A folder defines `PART` (`camkit.models_def.training.kind`) and, where its networks can be
fine-tuned, `REFINING` (`camkit.models_def.training.refinement`).
"""
