"""The robot in DART, whose contacts are of another family than MuJoCo's."""
