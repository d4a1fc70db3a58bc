"""DAgger: a network with the deployment observation learns the tracker's joint targets."""
