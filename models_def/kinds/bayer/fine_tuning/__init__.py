"""Fine-tuning: a trained network against two discriminators, and training on real pairs.

    homography    from a reference picture to a capture of it
    pair_settings, pair_photographs    pairs.toml, and the files beside it as linear light
    alignment     a pair with distortion, homography and colours told apart
    photographed  a pair of two photographs from one place
    aligned_pairs a folder of real pairs -> each aligned, with what counts of it
    pairs         these -> samples like those of the pool
    bayer_refinement    fitted against a global and a local discriminator, by the ordinary trainer

References: Sun 2021, sections 6.2.2 and 6.3.1.
"""
