"""MuJoCo rollouts, the torque a motor can give, and what a motion asks of the motors and the ground."""
