"""What design time knows of each kind of camera: one folder each.

The part of a kind for this floor gives `TRAINING` (camkit/models_def/training/kind.py) and, where
its networks can be fine-tuned, `REFINING` (camkit/models_def/training/refinement.py).
"""
