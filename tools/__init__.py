"""The commands around the estimator: `gritd` and what it starts."""
