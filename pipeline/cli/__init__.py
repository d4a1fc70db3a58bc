"""`booster-lab`: what a person types. A file a command; all work is done by the stages."""
