"""AMP training on mjlab and rsl-rl. Imports nothing of the rest of the project: GPU hosts have no dagster, placo or pin."""
