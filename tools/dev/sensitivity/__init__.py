"""How far a diagnosis moves when a tuned number is halved or doubled."""
