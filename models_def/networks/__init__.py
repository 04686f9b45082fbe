"""Recovery networks, torch.

    capture + Wiener planes -> lean_unet      the CPU-first family, sizes S, M, L
                            -> trimmed_unet   the thesis's trimmed U-Net, a reference
                               catalog        their names, for recipes and checkpoints

Every network takes (batch, 6 or 3, h, w) float32 stabilised planes, h and w multiples of its total
stride, and gives (batch, 3, h, w). The last three input planes are the ones it corrects.
"""
