"""AMP training on mjlab and rsl_rl. Training (not validation) needs only their packages beside this project's code."""
