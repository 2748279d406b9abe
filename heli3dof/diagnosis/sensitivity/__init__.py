"""First-order responses of the predictor and of the torques to small changes of the model."""
