"""Fine-tuning: a trained network against two discriminators and on real pairs.

    homography    from a reference picture to a capture of it
    alignment     a pair with distortion, homography and colours told apart
    pairs         a folder of real pairs -> samples like those of the pool
    refinement    fitted against a global and a local discriminator, as the ordinary trainer runs it

References: Sun 2021, sections 6.2.2 and 6.3.1.
"""
