"""Fine-tuning: a trained network against two discriminators and on real pairs.

    homography    from a reference picture to a capture of it
    alignment     a pair with distortion, homography and colours told apart
    pairs         a folder of real pairs -> samples like those of the pool
    vgg           features of VGG-19 from a weights file of the user's
    content       features of output and truth; eq. (6.12)
    adversarial   RaGAN-LS, eq. (6.13) with its signs
    fitter        one step: discriminators, then generator, eq. (6.14)
    refinement    all of it as the ordinary trainer runs it

References: Sun 2021, sections 6.2.2 and 6.3.1.
"""
