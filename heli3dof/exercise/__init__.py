"""Exercises: emulated rigs whose effects are encrypted, students' answers, and the marks."""
