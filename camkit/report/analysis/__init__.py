"""Analysis: what a camera can tell of a scene over the field, and what it only seems to tell.

In the order of the work of `camkit analyse field`:

    subject        a bundle, frozen optics, a lens or a pinhole, by name
    point_image    the image of a point: peak, lines, shares, MTF
    frozen_image   as frozen optics have it
    traced_image   by the rays of a lens (needs torch)
    bars           what two pixels on bars can tell: contrast, detection, CDP
    frozen_lens    a lens frozen so that it can be photographed with (needs torch)
    physical       a camera of physics alone around frozen optics
    recovery       whole frames photographed and restored, zone by zone
    lens_field     all of it, as JSON
    field_charts, field_page   on one page

In the order of the work of `camkit analyse hallucination`:

    unexplained    chi^2 of a picture, blurred again, against its capture
    perceptual     how different two pictures look
    patches        both, and the truth, patch by patch
    planted        the control: detail of ours
    invented_detail   all of it, as JSON
    hallucination_page   on one page
"""
