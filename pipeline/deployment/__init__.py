"""What runs on the robot: observation, network, joint targets. numpy only; simulators, exports and logs use this one."""
