"""Training, in the order in which data pass through it; common to all kinds of cameras.

    recipe                         what a person edits, checked
    kind                           what a kind of camera brings: scenes, samples, judging
    pictures                       where sharp scenes come from
    preparing, bank_fitting        samples and banks that a kind makes before
    sample                         what a network is given, and what it should make of it
    pool, pool_worker              finished samples on disk, made beside the training
    losses, schedule, fitter       one step
    precision                      in which numbers it multiplies
    fitting                        the steps that a kind brings
    adversarial                    such a step: content terms, and a critic
    trainer, log                   the run and its log
    checkpoint, credits            what is kept, and what it was trained on
    frozen_norms                   norms that look at a picture become constants, before an export
    first_weights, refinement      what was trained before goes on

A run that is interrupted goes on with the same bits.
"""
