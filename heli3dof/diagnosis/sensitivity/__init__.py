"""First-order changes of the filter's predictions by small changes of the model or its torques."""
