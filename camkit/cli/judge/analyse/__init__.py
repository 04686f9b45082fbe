"""Commands that say what a camera can tell of a scene, and what it only seems to.

field           light, detection and recovery over the field
hallucination   what restored pictures show that their captures do not hold
outputs         the page that both leave, and what they say
"""
