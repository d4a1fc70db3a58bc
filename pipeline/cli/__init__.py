"""The command line `booster-lab`, with one module per command or group; the stages do all work."""
