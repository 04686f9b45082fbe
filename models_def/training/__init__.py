"""Training, in the order in which data pass through it.

    recipe                         what a person edits, checked
    lens_bank, psf_bank            kernels of fabricated copies and of the frozen PSF
    pictures, samples              scenes photographed, filtered and stabilised
    pool, pool_worker              finished samples on disk, made beside the training
    losses, schedule, fitter       one step
    validation                     what a run is chosen by
    trainer, progress, log         the run, its bar and its log
    checkpoint, credits            what is kept, and what it was trained on
    fine_tuning/                   afterwards: discriminators, features, real pairs

A run that is interrupted goes on with the same bits.
"""
