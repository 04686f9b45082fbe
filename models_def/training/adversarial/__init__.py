"""Training by what a picture looks like, and against a critic (Sun 2021, section 3.5.2).

    views           output and truth as seen on a display
    content         |difference|, Gram matrices and features; eqs. (3.6), (3.7), (6.12)
    game            the rules between a generator and its opponents
    wasserstein     a critic with a gradient penalty; eq. (3.8)
    relativistic    RaGAN-LS; eq. (6.13)
    sharp           pictures without captures, for a critic
    opponents       who opposes a generator, and their steps
    picture_fitter  one step: the opponents, then the generator; eqs. (3.9), (6.14)
    picture_fitting  the fitter of any kind whose cameras make three colours

A recipe says `loss = "content"` for the content terms alone, `loss = "adversarial"` for a critic
beside them; the tables `content` and `critic` of its schedule say how much each term counts.
"""
