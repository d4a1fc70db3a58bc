"""AMP training on mjlab and rsl-rl. Imports nothing of the rest of the project: GPU hosts have only mjlab's stack."""
