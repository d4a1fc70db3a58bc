"""The pure code of Booster Lab: clips in, clips out. Nothing below this package knows of Dagster."""
