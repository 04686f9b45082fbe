"""Seconds: one capture through fresh processes, watched.

capture       the capture that is timed
process_run   a fresh process watched: seconds, memory of its tree, load of others
worker        that process, as any user's program
timing        order of the rounds; median, quantiles and noise of the seconds
"""
