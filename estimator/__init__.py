"""The estimator: physics, geometry, filter, recording. It never imports drivers or tools."""
