"""Training by what a picture looks like, and against a critic (Sun 2021, section 3.5.2).

    views         output and truth as seen on a display
    content       |difference|, Gram matrices and features; eqs. (3.6), (3.7)
    wasserstein   a critic's loss, its gradient penalty, a generator's loss; eq. (3.8)
    sharp         pictures without captures, for the critic
    judged        what fitters of a judged generator have in common
    fitter        one step: the critic several times, then the generator; eq. (3.9)
    fitting       the fitter of any kind whose cameras make three colours

A recipe says `loss = "content"` for the content terms alone, `loss = "adversarial"` for a critic
beside them; the tables `content` and `critic` of its schedule say how much each term counts.
"""
