"""The residual torque, and first-order changes of predictions by torques and parameters."""
