"""Every fault of the list gritd must survive, one scenario a row, each with three seeds and a
measured figure.
"""
