"""Tests and what they are made of; a package of its own, because installed packages bring a `tests`, too."""
