"""Exercises: sealed rigs with hidden effects, students' answers, and their marks."""
