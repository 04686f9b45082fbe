"""Commands that judge a camera and the machine it runs on.

check     prove a bundle
stress    where the networks stop helping
bench     speed against accuracy
analyse/  what it can tell of a scene, over the field
doctor    what this machine has
"""
