"""The plant: a testbed in the time domain with physics of its own. It shares no physics with
`estimator`.
"""
