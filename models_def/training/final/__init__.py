"""The final stage: a trained network, fine-tuned against two discriminators and on real pairs.

    homography    from a reference picture to a capture of it
    alignment     a pair with distortion, homography and colours told apart
    pairs         a folder of real pairs -> samples like those of the pool
    vgg           features of VGG-19 from a weights file of the user's
    content       output and truth as seen on a display; eq. (6.12)
    adversarial   RaGAN-LS, eq. (6.13) with its signs
    fitter        one step: discriminators, then generator, eq. (6.14)
    stage         all of it as a stage of the ordinary trainer

References: Sun 2021, sections 6.2.2 and 6.3.1.
"""
