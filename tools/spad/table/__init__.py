"""Tables 4.1 and 4.2: how an array samples, and what makes a picture of it.

rows       what is compared
training   its networks, each for the same CPU time
judged     what is judged: every training, and what needs none
measuring  every row on the test sets, at every level of light
record     means, their spread over seeds, gains; the thesis's figures
text       the tables
"""
