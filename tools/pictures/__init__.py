"""Pictures of README, gallery and guides.

- `gallery`: all pictures of README and gallery
- `guides`: those of guides and start pages; `portable_chain`, a drawing
- `views`: every built-in camera at work
- `crops`: crops of a capture, restored and sharp
- `captions`: rows of pictures in one file, a caption over each
"""
