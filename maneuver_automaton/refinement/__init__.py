"""Improvement of plans: words, smooth motions, and the pace along a path."""
