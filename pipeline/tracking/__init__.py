"""KP4: one policy that tracks many retargeted clips in simulation, and its rollouts on a CPU."""
