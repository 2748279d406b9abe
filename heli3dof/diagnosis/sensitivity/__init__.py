"""The residual torque, first-order changes of predictions by torques, and their projections."""
