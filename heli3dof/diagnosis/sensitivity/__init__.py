"""First-order changes of the filter's predictions by torques, and projections of them."""
