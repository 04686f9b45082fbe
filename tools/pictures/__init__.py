"""Pictures of the demo.

- `captions`: rows of pictures in one PNG, a caption over each
"""
