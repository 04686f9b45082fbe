"""Scenes and light as no training shows them: what was learned must hold outside the laboratory.

light_colour    the colour of the light, which nobody balances
dynamic_range   sun and shade in one picture
surroundings    what lies beside the picture is brighter or darker than it
"""
