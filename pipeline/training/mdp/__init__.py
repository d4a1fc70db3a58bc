"""MDP terms: commands, actions, observations, rewards, events, terminations, start states."""
