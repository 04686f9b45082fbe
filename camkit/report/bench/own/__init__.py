"""Kinds that measure themselves, since their captures are no photographs.

measuring   which bundles these are, and their rows in one report
table       the rows as text, a table for every sort
"""
