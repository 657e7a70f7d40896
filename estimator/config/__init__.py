"""The configuration file: strict YAML to typed settings in SI."""
