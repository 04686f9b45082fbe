"""The computation itself, whatever the camera sees.

picture_size   odd and tiny pictures
tile_seams     tiled against whole
fp16_range     activations against the range of half precision
resolution     contrast that is not in the scene
"""
