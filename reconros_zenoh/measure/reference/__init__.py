"""Measurements of the real boards, as summaries with their source."""
