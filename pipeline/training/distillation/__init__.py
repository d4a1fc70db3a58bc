"""DAgger: a network with the deployment's observation learns the joint targets of the tracker."""
