"""Pictures of README and gallery.

- `gallery`: all pictures of README and gallery
- `views`: every built-in camera at work
- `crops`: crops of a capture, restored and sharp
- `captions`: rows of pictures in one file, a caption over each
"""
