"""Search for causes: score tests of all candidates, and refits with the best candidates added."""
