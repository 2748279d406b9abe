"""Search for causes: score tests against simulated nulls, and full fits that are compared."""
