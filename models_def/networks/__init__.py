"""Recovery networks, torch.

    capture + Wiener planes -> lean_unet      the CPU-first family, sizes S, M, L
                            -> trimmed_unet   the thesis's trimmed U-Net, a reference
                            -> full_unet      its generator: the trimmed one with its deep scales
                            -> constant_unet  the single-stage U-Net of Deep Optics, a reference
                            -> nafnet         blocks without activation functions, a reference
                            -> normed_unet    the generator of the thin plate, a reference
                               instance_norm  its norms, and constants that stand in for them
                               catalog        their names, for recipes and checkpoints
    restored and true picture -> discriminator   opponents in training, never exported
                              -> vgg             features of VGG-19, weights from the user
    any of them              -> near_lights   one that acts beside lights alone
                             -> light         the bound on the light that it may move
    photons of an array       -> sub_pixel       the CPU-first network, four times as fine
                              -> back_projection, bicubic_first   references; on `bicubic`

Every network of the catalogue takes (batch, 6 or 3, h, w) float32 stabilised planes, h and w
multiples of its total stride, and gives (batch, 3, h, w). The last three input planes are the ones
it corrects.
"""
