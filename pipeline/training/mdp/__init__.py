"""Terms of the environment: commands, actions, observations, rewards, events, terminations, start states."""
