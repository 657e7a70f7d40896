"""Whether a run can be what it says it is: what physics or the configuration forbids."""
