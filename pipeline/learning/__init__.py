"""What tracking and adversarial training share: the robot in mjlab, plain physics, checkpoints, policy files."""
