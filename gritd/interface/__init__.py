"""What `import gritd` offers to Python programs and notebooks; `gritd` hands it on."""
