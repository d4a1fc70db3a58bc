"""Adversarial motion prior: expert windows, discriminator, replay, PPO with the style reward."""
