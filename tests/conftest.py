"""Property tests find the same examples every time, and no machine is too slow for them.

`pytest --hypothesis-profile explore` looks for new ones.
"""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "gritd", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile(
    "explore", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("gritd")
