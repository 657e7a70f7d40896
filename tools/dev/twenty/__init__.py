"""Twenty campaigns whose diagnoses must be the same before and after a change."""
