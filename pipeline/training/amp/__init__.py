"""Adversarial motion prior: expert windows, discriminator, replay buffer, PPO with the style reward."""
