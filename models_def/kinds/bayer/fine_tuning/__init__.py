"""Fine-tuning: a trained network against two discriminators and on real pairs.

    homography    from a reference picture to a capture of it
    alignment     a pair with distortion, homography and colours told apart
    pairs         a folder of real pairs -> samples like those of the pool
    bayer_refinement    fitted against a global and a local discriminator, by the ordinary trainer

References: Sun 2021, sections 6.2.2 and 6.3.1.
"""
